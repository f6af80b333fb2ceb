// The circuit page: parts are dragged, picked, put in by two keys, and taken out.
import { key, keysBefore, tell } from './lab.js'
import { notify } from './elements.js'
import { magnify } from './view.js'

const host = () => document.getElementById('circuit-host')
const say = (name, detail) => notify(host(), `circuit-${name}`, detail)
const chosen = () => document.querySelector('.diagram .part.on')?.dataset.part ?? ''
let inserting = false; let refocus = ''

function insert (on) {
  inserting = on
  document.body.classList.toggle('inserting', on)
  const hint = document.querySelector('.hint')
  if (!hint) return
  hint.dataset.words ??= hint.textContent
  hint.textContent = on ? `now the letter of a part${chosen() ? `, for ${chosen()}` : ''}; Esc leaves it` : hint.dataset.words
}
const target = e => e.target.closest?.('.diagram [data-part]')
// The part whose middle is nearest to where something was dropped beside all of them.
function nearest (x, y) {
  let best = null
  for (const one of document.querySelectorAll('.diagram .part')) {
    const b = one.getBoundingClientRect()
    const dx = Math.max(b.left - x, 0, x - b.right); const dy = Math.max(b.top - y, 0, y - b.bottom)
    if (!best || dx * dx + dy * dy < best.d) best = { d: dx * dx + dy * dy, part: one.dataset.part }
  }
  return best?.part ?? ''
}
function pick (part) { refocus = part; say('pick', { part: part === chosen() ? '' : part }) }

addEventListener('click', e => {
  const add = e.target.closest?.('[data-add]')
  if (add) { say('put', { part: add.dataset.add, at: chosen() }); insert(false); return }
  const one = target(e)
  if (one) pick(one.dataset.part)
})
addEventListener('dragstart', e => {
  const add = e.target.closest?.('[data-add]')
  if (add) { e.dataTransfer.setData('text/plain', `part:${add.dataset.add}`); e.dataTransfer.effectAllowed = 'copy' }
})
const unmark = () => document.querySelectorAll('.diagram .over').forEach(o => o.classList.remove('over'))
addEventListener('dragover', e => {
  if (!e.target.closest?.('.drawing')) return
  e.preventDefault()
  unmark()
  target(e)?.classList.add('over')
})
addEventListener('drop', e => {
  const words = e.dataTransfer?.getData('text/plain') ?? ''
  if (!words.startsWith('part:') || !e.target.closest?.('.drawing')) return
  e.preventDefault()
  unmark()
  say('put', { part: words.slice(5), at: target(e)?.dataset.part ?? nearest(e.clientX, e.clientY) })
})
addEventListener('dragend', unmark)

const inField = e => e.target.closest?.('input,textarea,select,[contenteditable=true]')
// Called before the keys of all pages; an event for which it returns true goes no further.
function own (e) {
  if (document.querySelector('dialog[open]')) return false
  if (inserting && e.key.length === 1 && !e.ctrlKey && !e.metaKey && !e.altKey) {
    const add = document.querySelector(`[data-key="${CSS.escape(e.key.toLowerCase())}"]`)
    if (add) say('put', { part: add.dataset.add, at: chosen() }); else tell(`No part has the letter ${e.key}.`)
    insert(false)
    return true
  }
  if (inserting && e.key === 'Escape' && document.documentElement.dataset.state === 'idle') { insert(false); return true }
  if (e.ctrlKey && e.key.toLowerCase() === 'z' && !inField(e)) {
    const undo = document.getElementById('circuit-undo')
    if (undo && !undo.hasAttribute('disabled')) { undo.click(); return true }
    return false
  }
  const part = document.activeElement?.closest?.('.diagram .part')
  if (part && (e.key === 'Enter' || e.key === ' ')) { pick(part.dataset.part); return true }
  if (part && /^Arrow(Left|Right|Up|Down)$/.test(e.key)) {
    const all = [...document.querySelectorAll('.diagram .part')].sort((a, b) => a.getBoundingClientRect().left - b.getBoundingClientRect().left)
    const to = all[all.indexOf(part) + (/Left|Up/.test(e.key) ? -1 : 1)]
    to?.focus()
    return true
  }
  return false
}
keysBefore.push(own)
key('Insert', 'put in a part: then its letter', () => insert(!inserting))
key('Delete', 'take the selected part out', () => { if (chosen()) say('take', { part: chosen() }) })

// The diagram is drawn anew with every change: who had the focus keeps it, and what was magnified stays so.
new MutationObserver(() => {
  const drawing = document.querySelector('.drawing')
  if (drawing?.querySelector('svg.diagram')) {
    drawing.zoomer ??= magnify(drawing, { find: () => drawing.querySelector('svg.diagram') })
    if (drawing.zoomer.range && !drawing.querySelector('svg.diagram').dataset.whole) drawing.zoomer.chart.show(drawing.zoomer.range)
  }
  if (!refocus || document.activeElement !== document.body) return
  document.querySelector(`.diagram .part[data-part="${CSS.escape(refocus)}"]`)?.focus()
  refocus = ''
}).observe(document.documentElement, { childList: true, subtree: true })
