// The elements of a page live on the server (elements.py): their changes come over a line of their own, their events go back.
import { act, link, tell } from './lab.js'

const element = id => document.querySelector(`[data-id="${id}"]`)
/** Functions that the server may call; a script of a page adds its own. */
export const calls = new Map(Object.entries({
  link,
  tell,
  openDialog: id => { const d = element(id); if (d && !d.open) d.showModal() },
  closeDialog: id => element(id)?.close(),
  setValue: (id, value) => { const e = element(id); if (e) e.value = value },
  download: (url, name) => { const a = document.createElement('a'); a.href = url; a.download = name; document.body.append(a); a.click(); a.remove() },
  goTo: url => { location.href = url },
  // what a page has made is chosen on the bench: pairs of an action, which is also a word of the bench's link, and a name
  toBench: async choices => {
    for (const [action, name] of choices) {
      const answer = await act(action, { name })
      if (!answer.ok) { tell(answer.said, 20); return }
    }
    location.href = `/?${new URLSearchParams(choices)}`
  }
}))

// ---------------------------------------------------------------- what the server does to the page
const typing = new WeakSet() // fields in which somebody types: their words stay
const operations = {
  insert: (place, html) => element(place)?.insertAdjacentHTML('beforeend', html),
  remove: id => element(id)?.remove(),
  inside: (id, html) => { const e = element(id); if (e) e.innerHTML = html },
  attributes: (id, now) => {
    const e = element(id)
    if (!e) return
    for (const [name, value] of Object.entries(now)) {
      if (value === null) { e.removeAttribute(name); continue }
      e.setAttribute(name, value)
      if (name === 'value' && 'value' in e && !typing.has(e)) e.value = value
    }
  },
  call: (name, ...given) => calls.get(name)?.(...given)
}

// What is pressed must not move before it is let go: leaving a field takes its message away, and a click falls on what then lies there.
const PRESS = 400 // ms that a click takes at most; a drag goes on beside what changes
let pressed = 0; const late = []
function carryOut (todo) {
  if (pressed) { late.push(...todo); return }
  for (const [name, ...given] of todo) operations[name](...given)
}
function letGo () {
  clearTimeout(pressed); pressed = 0
  carryOut(late.splice(0))
}
addEventListener('pointerdown', () => { clearTimeout(pressed); pressed = setTimeout(letGo, PRESS) }, true)
for (const name of ['pointerup', 'pointercancel']) addEventListener(name, () => { if (pressed) setTimeout(letGo) }, true) // the click comes first

// ---------------------------------------------------------------- line
const KEY = document.body.dataset.document
const UNKNOWN = 4404 // the server has no such document any more
let line = null; let seen = 0; let waits = 0
const unsent = []
function connect () {
  line = new WebSocket(`${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}/elements/${KEY}`)
  line.onopen = () => {
    waits = 0
    line.send(JSON.stringify({ seen }))
    for (const text of unsent.splice(0)) line.send(text)
  }
  line.onmessage = ({ data }) => {
    const message = JSON.parse(data)
    if (message.reload) { location.reload(); return }
    seen = message.n
    carryOut(message.do)
  }
  line.onclose = closed => {
    if (closed.code === UNKNOWN) { location.reload(); return }
    waits = Math.min(waits + 1, 5)
    setTimeout(connect, waits * 500)
  }
}
function send (id, event, value = null) {
  const text = JSON.stringify({ event: [+id, event, value] })
  if (line?.readyState === 1) line.send(text)
  else if (unsent.length < 20) unsent.push(text)
}
if (KEY) connect()
addEventListener('pagehide', () => { if (line) { line.onclose = null; line.close() } })
addEventListener('pageshow', e => { if (e.persisted && KEY) connect() })

// ---------------------------------------------------------------- events
const listens = (e, event) => e.dataset?.on && e.dataset.on.split(' ').includes(event)
const due = new Map() // element -> what it sends when its time has come
function tellServer (e, event, value) {
  const wait = +(e.dataset.wait ?? 0)
  if (!wait) { send(e.dataset.id, event, value); return }
  if (due.has(e)) { due.set(e, [event, value]); return }
  send(e.dataset.id, event, value)
  due.set(e, null)
  setTimeout(() => { const last = due.get(e); due.delete(e); if (last) tellServer(e, ...last) }, wait)
}
/** Every element from the target upwards that listens hears of an event; true where one does. */
function bubble (target, event, value) {
  let heard = false
  for (let e = target?.closest?.('[data-on]'); e; e = e.parentElement?.closest('[data-on]')) if (listens(e, event)) { heard = true; tellServer(e, event, value) }
  return heard
}
const valueOf = e => e.type === 'checkbox' ? e.checked : e.value
document.addEventListener('click', e => { bubble(e.target, 'click') })
for (const name of ['input', 'change']) {
  document.addEventListener(name, ({ target }) => {
    if (!target.matches?.('input,select,textarea') || target.type === 'file') return
    if (name === 'input') typing.add(target); else typing.delete(target)
    if (listens(target, name)) tellServer(target, name, valueOf(target))
  }, true)
}
document.addEventListener('blur', ({ target }) => typing.delete(target), true)
document.addEventListener('keydown', e => {
  if (e.key === 'Enter') {
    if (e.target.matches?.('input') && listens(e.target, 'entered')) tellServer(e.target, 'entered', e.target.value)
    bubble(e.target, 'enter')
  } else if (e.key === ' ' && e.target.matches?.('[data-on~="space"]')) { e.preventDefault(); bubble(e.target, 'space') }
})
document.addEventListener('close', ({ target }) => { if (listens(target, 'close')) send(target.dataset.id, 'close') }, true)
/** An event of a page's own script, with anything that JSON holds. */
export function notify (e, event, value) { if (e && listens(e, event)) tellServer(e, event, value) }

// ---------------------------------------------------------------- files
const zone = e => e.target.closest?.('[data-takes]')
function upload (picker, file) {
  const allowed = picker.accept.split(',').some(ending => file.name.toLowerCase().endsWith(ending))
  if (!allowed || file.size > +picker.dataset.most) { send(picker.dataset.id, 'rejected', file.name); return }
  fetch(`/upload/${KEY}/${picker.dataset.id}?name=${encodeURIComponent(file.name)}`, { method: 'POST', body: file })
    .then(answer => { if (!answer.ok) send(picker.dataset.id, 'rejected', file.name) }, () => tell(`${file.name} did not reach the server.`))
}
document.addEventListener('change', ({ target }) => {
  if (target.type !== 'file' || !target.dataset.id) return
  for (const file of target.files) upload(target, file)
  target.value = ''
})
document.addEventListener('click', e => {
  const chooser = e.target.closest?.('[data-chooses]')
  if (chooser) element(chooser.dataset.chooses)?.click()
})
document.addEventListener('dragover', e => { const z = zone(e); if (z) { e.preventDefault(); z.classList.add('over') } })
document.addEventListener('dragleave', e => zone(e)?.classList.remove('over'))
document.addEventListener('drop', e => {
  const z = zone(e)
  if (!z) return
  e.preventDefault()
  z.classList.remove('over')
  const picker = element(z.dataset.takes)
  for (const file of e.dataTransfer.files) upload(picker, file)
})
