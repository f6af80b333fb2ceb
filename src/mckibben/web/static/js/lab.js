// The connection to the server, and the common parts of all pages: state block, emergency stop, keyboard, theme, toasts, footer.
import { fmt, forget, projected, say, words } from './words.js'

export const events = new EventTarget()
// `page` is the public name of this page, as everybody sees it; `server` the identity of the server that it speaks to
export const lab = { status: null, parts: {}, log: [], open: false, lost: null, epoch: null, page: '', server: '' }
const emit = (name, detail) => events.dispatchEvent(new CustomEvent(name, { detail }))
const $ = s => document.querySelector(s)

// The secret of this page makes it the same page again after a reload or a lost line. It is nowhere but in this module, and for
// the moment of a reload in the tab's storage: a tab that is duplicated copies that storage, but finds no secret in it.
let secret = taken('mckibben-secret') ?? ''
// What the page knew last, so that it can say after a restart of the server what is lost: {server, run, hand, file}
let last = JSON.parse(sessionStorage.getItem('mckibben-last') ?? 'null')
function taken (name) {
  const value = sessionStorage.getItem(name)
  sessionStorage.removeItem(name)
  return value
}
/** Keep what was known of the machine, for when another server answers. */
function remember () {
  const s = lab.status
  if (!lab.server || !s) return
  const run = s.running ? { title: s.title, time: s.time } : null
  last = { server: lab.server, run, hand: s.name === 'By hand', file: run ? s.file : s.ended?.file ?? '' }
  sessionStorage.setItem('mckibben-last', JSON.stringify(last))
}

// ---------------------------------------------------------------- line
const UNKNOWN = 4401; const CROWDED = 4429; const REPLACED = 4409 // why a line was closed: guard.py, live.py
let socket = null; let waits = 0; let retry = null; let seen = { epoch: 0, count: 0 }
const pending = new Map(); let asked = 0

function connect () {
  clearTimeout(retry)
  socket = new WebSocket(`${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}/live`)
  socket.binaryType = 'arraybuffer'
  socket.onopen = () => {
    waits = 0
    socket.send(JSON.stringify({
      secret, stream: document.body.dataset.stream === '1', server: lab.server || last?.server, file: last?.file,
      epoch: seen.epoch, seen: seen.count, log: lab.log.at(-1)?.number ?? 0
    }))
  }
  socket.onmessage = m => typeof m.data === 'string' ? heard(JSON.parse(m.data)) : frame(m.data)
  socket.onclose = gone
}

function gone (closed) {
  socket = null
  if (lab.open) { remember(); lab.open = false; lab.lost = lab.status?.time ?? 0; emit('lost') }
  for (const { no } of pending.values()) no(new Error('lost'))
  pending.clear()
  if (closed?.code === REPLACED) secret = '' // somebody else is this page now
  refusal(closed?.code === UNKNOWN || closed?.code === CROWDED ? closed.reason : '')
  waits = Math.min(waits + 1, 5)
  const at = performance.now() + waits * 1000
  const count = () => {
    const left = Math.ceil((at - performance.now()) / 1000)
    if (left <= 0) { connect(); return }
    show(left)
    retry = setTimeout(count, 250)
  }
  count()
}

/** The server says who it is, and who this page is for it. */
function hello (message) {
  const before = lab.server || last?.server
  lab.server = message.server; lab.page = message.page; secret = message.secret
  socket.send(JSON.stringify({ kept: true }))
  const e = $('#address')
  if (e) e.textContent = `${message.address} \u00b7 v${message.version}`
  refusal('')
  if (before && before !== lab.server) restarted(message.saved)
}
/** Another server than before: nothing of the one before is shown any more, and the page says what is lost. */
function restarted (saved) {
  seen = { epoch: 0, count: 0 }
  Object.assign(lab, { status: null, parts: {}, log: [], epoch: null, lost: null })
  emit('restart')
  const { run, hand, file } = last ?? {}
  let text = 'The server was restarted.'
  if (run) {
    const what = `The run that was going on (${run.title}, at ${fmt(run.time ?? 0, 3)} s)`
    if (!saved) text += ` ${what} is lost, and no recording of it was saved.`
    else text += ` ${what} ended with it. What was recorded until then is kept as ${saved}.`
  } else if (hand) text += ' The set-points by hand ended with it.'
  text += ' Samples and messages of before are not shown any more.'
  if (!run && file && saved) text += ` The last recording, ${saved}, is kept.`
  last = null
  sessionStorage.removeItem('mckibben-last')
  sessionStorage.setItem('mckibben-news', text) // other parts of the page may load it anew
  news()
}
/** What a person has to have read before it goes. */
function news () {
  const text = sessionStorage.getItem('mckibben-news')
  $('#news')?.remove()
  if (!text) return
  const bar = toast(say(text))
  bar.id = 'news'
  bar.setAttribute('role', 'alert')
  button(bar, 'Close', () => { sessionStorage.removeItem('mckibben-news'); bar.remove() })
}
/** Why the server does not let this page in; it stands until it does. */
function refusal (text) {
  const there = $('#refusal')
  if ((there?.firstChild.textContent ?? '') === text) return
  there?.remove()
  if (!text) return
  const bar = toast(text)
  bar.id = 'refusal'
  bar.setAttribute('role', 'alert')
}

const HEAD = 24
function frame (data) {
  const server = [...new Uint8Array(data, 0, 8)].map(b => b.toString(16).padStart(2, '0')).join('')
  if (server !== lab.server) return
  const [epoch, first, n, m] = new Uint32Array(data, 8, 4)
  seen = { epoch, count: first + n }
  const values = []
  for (let i = 0; i < m; i++) values.push(new Float32Array(data, HEAD + 4 * i * n, n))
  emit('frame', { server, epoch, first, n, values })
  // a machine waits for the page that can stop it
  if (lab.status?.running && lab.status.holder === lab.page) {
    socket.send(JSON.stringify({ epoch, shown: first + n }))
  }
}

function heard (message) {
  const { type } = message
  if (type === 'hello') hello(message)
  else if (type === 'status') {
    const before = lab.status
    lab.status = message.status
    if (!lab.open) { lab.open = true; const was = lab.lost; lab.lost = null; emit('back', was) }
    show()
    emit('status', before)
  } else if (type === 'part') { lab.parts[message.name] = message.part; emit('part', message.name) } else if (type === 'log') {
    lab.log.push(...message.log); lab.log.splice(0, Math.max(0, lab.log.length - 500)); emit('log', message.log)
  } else if (type === 'epoch') { lab.epoch = message.epoch; emit('epoch') } else if (type === 'toasts') toasts(message.toasts)
  else if (type === 'answer') {
    const one = pending.get(message.id)
    pending.delete(message.id)
    one?.yes(message)
  }
}

/** Request an action of the server; resolves to {ok, said, field}. */
export function act (action, given = {}) {
  if (!socket || socket.readyState !== 1) return Promise.resolve({ ok: false, said: words.cannot, lost: true })
  return new Promise((resolve, reject) => {
    pending.set(++asked, { yes: resolve, no: reject })
    socket.send(JSON.stringify({ id: asked, act: action, words: given }))
  }).catch(() => ({ ok: false, said: words.cannot, lost: true }))
}

// ---------------------------------------------------------------- state block and emergency stop
const ICONS = {
  idle: '<circle cx="13" cy="13" r="9" fill="none" stroke="currentColor" stroke-width="2.5"/>',
  running: '<path d="M7 4l15 9-15 9z" fill="currentColor"/>',
  paused: '<path d="M6 4h5v18H6zM15 4h5v18h-5z" fill="currentColor"/>',
  tripped: '<path d="M8.500 1h9l7.500 7.500v9L17.500 25h-9L1 17.500v-9z" fill="currentColor"/><path d="M13 6v9M13 17.500v3" stroke="var(--stop)" stroke-width="3.200"/>',
  lost: '<path d="M3 13h7m6 0h7M12 7l2 12" stroke="currentColor" stroke-width="3"/>'
}
const NAMES = { idle: 'Idle', running: 'Running', paused: 'Paused', tripped: 'Tripped', lost: 'No connection' }
const TITLE = { running: '\u25b6 ', paused: '\u275a\u275a ', tripped: '\u2b23 Tripped: ' }
export const shape = () => !lab.open ? 'lost' : lab.status?.shape ?? 'idle'
let shown = ''

function show (left) {
  const state = shape(); const status = lab.status ?? {}
  const small = state === 'lost' ? (lab.status || left ? `trying again in ${left ?? 1}\u2009\u2060s` : 'connecting') : say(status.small ?? '')
  const name = state === 'lost' && !lab.status && !left ? 'Connecting' : status.name && state !== 'lost' ? status.name : NAMES[state]
  const key = [state, name, small].join('|')
  if (key !== shown) {
    const block = $('#state > .state')
    if (!block) return
    const words = block.querySelector('.w')
    if (!shown.startsWith(state + '|')) {
      block.className = `state ${state}`
      block.setAttribute('role', state === 'tripped' || state === 'lost' ? 'alert' : 'status')
      words.querySelector('small').setAttribute('aria-live', state === 'running' ? 'off' : 'polite') // cycles are counted there
      block.querySelector('svg').innerHTML = ICONS[state]
    }
    if (words.firstChild.textContent !== name) words.firstChild.textContent = name // the same words again would be said again
    words.querySelector('small').textContent = small
    document.title = (TITLE[state] ?? '') + document.title.replace(/^(\u25b6 |\u275a\u275a |\u2b23 Tripped: )/, '')
    document.documentElement.dataset.state = state
    shown = key
  }
  for (const button of document.querySelectorAll('.estop')) {
    const [text, sub, off] = state === 'lost' ? ['Emergency stop', 'cannot reach the machine', true]
      : status.vented ? ['Vented', 'stays until it is reset', false] : ['Emergency stop', button.closest('.ph') || !stops() ? 'vents at once' : 'vents at once \u00b7 Esc', false]
    const span = button.querySelector('span')
    if (span.firstChild.textContent !== text || span.querySelector('small').textContent !== sub) {
      span.firstChild.textContent = text; span.querySelector('small').textContent = sub
      button.classList.toggle('off', off); button.classList.toggle('vented', text === 'Vented')
      button.setAttribute('aria-disabled', String(off))
    }
  }
  foot()
}

export async function emergency (reason) {
  const answer = act('emergency_stop', { reason })
  if (socket?.readyState === 1) return answer
  // the line is gone: the other way, which may still be open
  try {
    const sent = await fetch('/emergency-stop', { method: 'POST', body: reason, keepalive: true })
    return { ok: sent.ok, said: sent.ok ? 'vented' : words.cannot }
  } catch { tell(words.cannot); return { ok: false, said: words.cannot } }
}

// ---------------------------------------------------------------- footer, controls, toasts
let rates = ''
export function rate (text) { rates = text; foot() }
function foot () {
  const live = $('#live'); const who = $('#who'); const status = lab.status
  if (!live) return
  const text = lab.open ? `Live${rates ? ` \u00b7 ${rates}` : ''}` : 'No connection'
  if (live.textContent !== text) live.textContent = text
  if (!status) return
  const mine = status.holder === lab.page; const n = status.watching
  const others = mine ? n : Math.max(0, n - 1)
  const said = mine ? 'You control' : status.present ? 'You watch' : 'You watch, nobody is in control'
  const line = `${said} \u00b7 ${mine ? `${n} watching` : `${others} other${others === 1 ? '' : 's'} watching`}`
  if (who.textContent !== line) who.textContent = line
  const ask = $('#ask-control')
  ask.hidden = mine || !lab.open
  const label = status.present ? (status.wanted === lab.page ? 'Asked for the controls' : 'Ask for the controls') : 'Take the controls'
  if (ask.textContent !== label) ask.textContent = label
  wanted(mine && status.wanted)
}

function wanted (by) {
  let bar = $('#wanted')
  if (!by) { bar?.remove(); return }
  if (bar) return
  bar = toast('A page that watches asks for the controls.')
  bar.id = 'wanted'
  button(bar, 'Hand over', () => act('give_control'))
  button(bar, 'Keep', () => act('keep_control'))
}
function toast (text) {
  const bar = document.createElement('div')
  bar.className = 'toast'
  bar.setAttribute('role', 'status')
  const span = document.createElement('span')
  span.textContent = text
  bar.append(span)
  $('#toasts').append(bar)
  return bar
}
function button (bar, text, click) {
  const b = document.createElement('button')
  b.className = 'btn s'; b.textContent = text; b.onclick = click
  bar.append(b)
  return b
}
/** A line at the foot of the page that goes by itself, with a link to another page where `go` has its words and address. */
export function tell (text, seconds = 8, go = null) {
  for (const old of document.querySelectorAll('.toast.told')) if (old.firstChild.textContent === text) old.remove()
  const bar = toast(text)
  if (go) bar.append(Object.assign(document.createElement('a'), { className: 'btn s', textContent: go.words, href: go.address }))
  bar.classList.add('told')
  setTimeout(() => bar.remove(), seconds * 1000)
}
const bars = new Map()
function toasts (list) {
  const there = new Set(list.map(t => t.number))
  for (const [n, bar] of bars) if (!there.has(n)) { clearInterval(bar.clock); bar.remove(); bars.delete(n) }
  for (const t of list) {
    let bar = bars.get(t.number)
    if (!bar) {
      bar = toast(t.text)
      if (t.undo) {
        const b = button(bar, 'Undo', async () => { const a = await act('undo', { number: t.number }); if (!a.ok) tell(a.said) })
        b.insertAdjacentHTML('beforeend', ' <kbd>Ctrl Z</kbd>')
      }
      bar.left = bar.appendChild(document.createElement('span'))
      bar.left.className = 'left'
      const close = button(bar, '\u00d7', () => act('toast', { number: t.number }))
      close.setAttribute('aria-label', 'Close')
      for (const [on, waits] of [['mouseenter', true], ['focusin', true], ['mouseleave', false], ['focusout', false]]) {
        bar.addEventListener(on, () => act('toast', { number: t.number, waits }))
      }
      bar.clock = setInterval(() => count(bar), 250)
      bars.set(t.number, bar)
    }
    bar.until = t.waits ? null : performance.now() + t.left * 1000
    bar.still = t.left
    count(bar)
  }
}
function count (bar) {
  const left = bar.until === null ? bar.still : Math.max(0, (bar.until - performance.now()) / 1000)
  bar.left.textContent = `${Math.ceil(left)}\u2009\u2060s`
}

// ---------------------------------------------------------------- theme, links, keyboard
const root = document.documentElement
export const dark = () => root.dataset.theme ? root.dataset.theme === 'dark' : matchMedia('(prefers-color-scheme:dark)').matches
function theme (to) {
  if (to) root.dataset.theme = to; else delete root.dataset.theme
  forget()
  emit('theme')
}
function projector (on) {
  if (on) root.dataset.projector = '1'; else delete root.dataset.projector
  sessionStorage.setItem('mckibben-projector', on ? '1' : '0')
  link({ projector: on ? '1' : '' })
  $('#projector').setAttribute('aria-pressed', String(on))
  emit('projector')
}
/** Put part of the state of the view into the address, so that the link can be sent. */
export function link (state) {
  const url = new URL(location.href)
  for (const [k, v] of Object.entries(state)) {
    if (v === null || v === undefined || v === '') url.searchParams.delete(k); else url.searchParams.set(k, v)
  }
  history.replaceState(null, '', url)
}
const keys = new Map()
/** A key of one page: `key('n', 'note at the cursor', fn)`; single keys work outside fields only. */
export function key (name, about, fn) { keys.set(name, { about, fn }) }
/** Keys of one page that go before those of all: functions that say whether they took an event. */
export const keysBefore = []
/** Whether a run is seen here, so that Esc stops it; elsewhere Esc closes what is open. */
const stops = () => document.body.dataset.page === 'bench'
const inField = e => e.target.closest?.('input:not([type=radio]):not([type=checkbox]):not([type=range]),textarea,select,[contenteditable=true]')
let after = -Infinity
const singles = () => localStorage.getItem('mckibben-keys') !== 'off'

function pressed (e) {
  if (keysBefore.some(took => took(e))) { e.preventDefault(); e.stopImmediatePropagation(); return }
  if (e.key === 'Escape') {
    const moving = lab.status?.moving || !lab.open
    if (moving && stops()) { e.preventDefault(); e.stopPropagation(); emergency('Esc was pressed'); return }
    const open = document.querySelector('dialog[open]')
    if (open) { open.close(); return }
    if (document.body.classList.contains('nav')) { document.body.classList.remove('nav'); return }
    emit('escape')
    if (moving && lab.open) tell('Esc stops a run on the page Bench, where it is seen; here the button Emergency stop does.')
    return
  }
  if (e.ctrlKey && e.key.toLowerCase() === 'z' && !inField(e)) { e.preventDefault(); act('undo', { bench: document.body.dataset.page === 'bench' }).then(a => (!a.ok || document.body.dataset.page === 'bench') && tell(say(a.said))); return }
  if (e.ctrlKey || e.metaKey || e.altKey || inField(e) || document.querySelector('dialog[open]')) return
  if (e.target.closest?.('[data-zooms]') && '+-=0'.includes(e.key) && !e.target.closest('#strips')) return // of a chart, which has the focus
  if (!singles()) return
  const page = e.timeStamp - after < 1500 && /^[a-z]$/i.test(e.key) && $(`.tabs a[data-key=${e.key.toLowerCase()}]`)
  if (page) { after = -Infinity; location.href = page.href; return }
  if (e.key.toLowerCase() === 'g') { after = e.timeStamp; return } // when it was pressed, however busy the page is
  if (e.key === '?') { help(); return }
  const on = e.target.closest?.('button,a,summary,[role=tab],[role=radio],[role=option],input')
  if (on && (e.key === ' ' || e.key === 'Enter' || e.key.startsWith('Arrow'))) return
  const one = keys.get(e.key.length === 1 ? e.key.toLowerCase() : (e.shiftKey ? 'Shift+' : '') + e.key)
  if (one) { e.preventDefault(); one.fn(e) }
}
function help () {
  const box = $('#keys')
  const rows = [...keys].filter(([, k]) => k.about).map(([name, k]) => `<tr><td><kbd>${name === ' ' ? 'Space' : name.replace('Arrow', '')}</kbd></td><td></td></tr>`)
  box.querySelector('tbody.own').innerHTML = rows.join('')
  ;[...keys].filter(([, k]) => k.about).forEach(([, k], i) => { box.querySelectorAll('tbody.own tr')[i].lastChild.textContent = k.about })
  box.querySelector('input').checked = singles()
  box.showModal()
}

addEventListener('keydown', pressed, true)
addEventListener('DOMContentLoaded', () => {
  const asked = new URLSearchParams(location.search).get('theme') ?? sessionStorage.getItem('mckibben-theme')
  if (asked === 'dark' || asked === 'light') theme(asked)
  document.body.append($('footer.foot'), $('#toasts'))
  news()
  for (const b of document.querySelectorAll('.estop')) {
    b.addEventListener('click', () => emergency('the button on the page was pressed'))
  }
  $('.menu').onclick = () => { document.body.classList.toggle('nav'); $('.menu').setAttribute('aria-expanded', String(document.body.classList.contains('nav'))) }
  $('#theme').onclick = () => { const to = dark() ? 'light' : 'dark'; theme(to); sessionStorage.setItem('mckibben-theme', to); link({ theme: to }) }
  $('#projector').onclick = () => projector(!projected())
  $('#projector').setAttribute('aria-pressed', String(projected()))
  key('j', '', () => projector(!projected()))
  $('#keys-button').onclick = help
  $('#copy').onclick = async () => {
    try { await navigator.clipboard.writeText(location.href); tell(`The link to this view was copied.${lab.missing?.() ?? ''}`) } catch { tell(`The link: ${location.href}`, 20) }
  }
  $('#ask-control').onclick = async () => { const a = await act('ask_control'); tell(a.said) }
  $('#keys input').onchange = e => localStorage.setItem('mckibben-keys', e.target.checked ? 'on' : 'off')
  matchMedia('(prefers-color-scheme:dark)').addEventListener('change', () => theme(root.dataset.theme))
  setTimeout(() => theme(root.dataset.theme), 0)
  connect()
})
addEventListener('pagehide', () => {
  remember()
  if (secret) sessionStorage.setItem('mckibben-secret', secret)
  socket?.close()
})
addEventListener('pageshow', e => { if (e.persisted) secret = taken('mckibben-secret') ?? '' }) // the tab has gone on meanwhile
/** Let the line go, as a network does; for tests and for nobody else. */
const drop = () => socket?.close()
window.lab = { lab, events, act, link, tell, key, drop }
