// The protocol as a form and as text, side by side: change any, the others follow.
import { act, events, lab } from './lab.js'
import { idle, sentence } from './setup.js'
import { escape, say } from './words.js'

const $ = s => document.querySelector(s)
const box = $('#ed')
const SIGN = '<svg width="13" height="13" aria-hidden="true"><circle cx="6.500" cy="6.500" r="6" fill="none" stroke="currentColor" stroke-width="1.300"/><path d="M6.500 3v4.500M6.500 9v1.500" stroke="currentColor" stroke-width="1.500"/></svg>'
const bad = {} // name -> {words, said}
let opened = false; let shown = '' // name of the protocol in the form
let typing = null // the field whose words nobody has been told yet
let answer = null // what became of saving: ok, said, and the name where it was refused

export function open (face) {
  opened = true; answer = null
  box.hidden = false
  build()
  const to = face === 'text' ? box.querySelector('textarea') : box.querySelector('.f input,.f select')
  to?.focus()
  press(face)
}
export function close () { opened = false; box.hidden = true; press('sentence') }
function press (face) { for (const b of document.querySelectorAll('#faces button')) b.setAttribute('aria-pressed', String(b.dataset.face === face)) }

function build () {
  const p = lab.parts.protocol; const d = lab.parts.dry ?? {}; const free = idle()
  if (p.name !== shown) { shown = p.name; for (const name of Object.keys(bad)) delete bad[name] } // what was refused was of another one
  const first = d.findings?.[0]; const off = free ? '' : 'disabled'
  const fields = p.form.map(f => {
    const wrong = bad[f.name] ?? (first && d.cure?.name === f.name ? { words: f.value, said: `${first.sentence}${d.cure ? `. ${d.cure.sentence}` : ''}` } : null)
    const id = `f-${f.name}`
    return `<div class="f"><label for="${id}" class="${{ pressure: 'P', tension: 'F', length: 'L' }[f.colour] ?? ''}">${escape(f.label)}${f.inferred ? ' <span class="faint">(inferred)</span>' : ''}</label><div class="field s ${wrong ? 'bad' : ''}"><input id="${id}" data-name="${escape(f.name)}" value="${escape(wrong?.words ?? f.value)}" ${off} ${wrong ? 'aria-invalid="true"' : ''} ${f.options ? `list="o-${id}"` : ''}>${f.options ? `<datalist id="o-${id}">${f.options.map(o => `<option value="${escape(o)}">`).join('')}</datalist>` : ''}<span class="u">${escape(f.unit)}</span></div>${wrong ? `<span class="err" role="alert">${SIGN}<span>${escape(say(wrong.said))}</span></span>` : ''}${f.about || f.allowed ? `<span class="about">${escape(say([f.about, f.allowed].filter(Boolean).join('; ')))}</span>` : ''}</div>`
  }).join('')
  const n = d.findings?.length ?? 0
  box.innerHTML = `<div class="hd"><h2>${escape(p.title)}</h2><span class="small ${answer ? answer.ok ? '' : 'err' : 'faint'}" id="ed-said" role="status">${escape(say(answer?.said ?? 'form, text and sentence are one protocol: change any'))}</span><span class="grow"></span><input class="field s" id="save-as" placeholder="name" aria-label="Name to save as" value="${escape(answer?.name ?? '')}" ${answer?.name ? '' : 'hidden'} style="width:130px"><button class="btn s" id="save">Save as</button><button class="btn s q" id="ed-close">Close</button></div><div class="two"><div>${fields || '<p class="faint">This protocol has no parameters.</p>'}</div><div><h3 style="margin-bottom:4px"><label for="ed-text">Text</label></h3><textarea id="ed-text" spellcheck="false" ${off}></textarea><div class="err" id="text-err" role="alert"></div></div></div><ol class="sent"></ol><div class="hd" style="border-top:1px solid var(--rule);border-bottom:0;min-height:44px"><span class="grow ${n ? 'err' : ''}" id="ed-dry">${d.pending ? 'The dry run is being made.' : n ? `Dry run: ${n} ${n === 1 ? 'finding' : 'findings'}. Nothing may start.` : 'Dry run passed.'}</span><button class="btn s" id="again">Dry run again</button>${d.cure ? `<button class="btn s pri" id="use">Use ${escape(say(d.cure.words))}</button>` : ''}</div>`
  const text = box.querySelector('textarea')
  text.value = bad.text?.words ?? p.text
  if (bad.text) $('#text-err').innerHTML = `${SIGN}<span>${escape(say(bad.text.said))}. The old text stays in use.</span>`
  typing = null
  text.onchange = () => change('text', { text: text.value }, 'text', text.value)
  text.oninput = () => { $('#ed-dry').textContent = 'Changed, not taken yet: Ctrl Enter takes the text, and leaving it does.' }
  text.onkeydown = e => { if (e.key === 'Enter' && (e.ctrlKey || e.metaKey)) text.dispatchEvent(new Event('change', { bubbles: true })) }
  box.querySelectorAll('.f input').forEach(i => { i.onchange = () => change('value', { name: i.dataset.name, words: i.value }, i.dataset.name, i.value) })
  sentence(box.querySelector('.sent'), free, d.cure?.name, new Set((d.findings ?? []).map(f => f.path)))
  $('#ed-close').onclick = close
  $('#again').onclick = () => act('dry_run')
  if ($('#use')) $('#use').onclick = () => act('cure')
  $('#save').onclick = save
}
async function change (action, given, name, words) {
  const a = await act(action, given)
  if (a.ok) delete bad[name]
  else bad[name] = { words, said: name === 'text' ? a.said : `${a.said}. The old value, ${lab.parts.protocol.form.find(f => f.name === name)?.value}, stays in use.` }
  if (!a.ok) refresh()
}
async function save () {
  const name = $('#save-as')
  if (name.hidden) { name.hidden = false; name.focus(); typing = name; return }
  const a = await act('save', { name: name.value.trim() })
  typing = null
  answer = { ok: a.ok, said: a.said, name: a.ok ? '' : name.value }
  refresh() // the parts that follow draw it again
}
function refresh () {
  if (!opened) return
  if (typing?.isConnected || box.querySelector('.sent input')) return // what somebody types stays
  const at = document.activeElement
  const key = box.contains(at) ? at.id : ''
  const whole = key && at.value && at.selectionStart === 0 && at.selectionEnd === at.value.length
  build()
  const now = key ? document.getElementById(key) : null
  now?.focus()
  if (whole) now?.select?.()
}
box.addEventListener('input', e => { typing = e.target })
box.addEventListener('change', e => { if (e.target === typing) typing = null }, true)
box.addEventListener('focusout', e => { if (e.target === typing && !(e.target.id === 'save-as' && e.target.value)) { typing = null; refresh() } })
events.addEventListener('part', e => { if (e.detail === 'protocol' || e.detail === 'dry') refresh() })
events.addEventListener('escape', close)
for (const b of document.querySelectorAll('#faces button')) b.onclick = () => b.dataset.face === 'sentence' ? close() : open(b.dataset.face)
if (new URLSearchParams(location.search).get('view') === 'edit') {
  const wait = () => { if (lab.parts.protocol) { open('form'); events.removeEventListener('part', wait) } }
  events.addEventListener('part', wait)
}
