// The left column: muscle, circuit and rig, the protocol's three faces, the dry run, and set-points by hand.
import { act, events, lab, link, shape, tell } from './lab.js'
import { small } from './muscle.js'
import { Q, TS, clamp, escape, fmt, keySign, say } from './words.js'

const $ = s => document.querySelector(s)
const LOCK = '<svg class="lock" width="12" height="13" viewBox="0 0 12 13" aria-hidden="true"><path d="M3 6V4a3 3 0 016 0v2" fill="none" stroke="currentColor" stroke-width="1.500"/><rect x="1" y="6" width="10" height="7" rx="1" fill="currentColor"/></svg>'
const SIGN = '<svg width="13" height="13" aria-hidden="true"><circle cx="6.500" cy="6.500" r="6" fill="none" stroke="currentColor" stroke-width="1.300"/><path d="M6.500 3v4.500M6.500 9v1.500" stroke="currentColor" stroke-width="1.500"/></svg>'
const FAR = 10 // times a limit, beyond which only that is said
export const idle = () => shape() === 'idle' || lab.status?.name === 'By hand'
const setup = () => lab.parts.setup
const factor = q => setup()?.units[q]?.factor ?? 1
export const mine = () => lab.status?.holder === lab.page
export async function asks (action, given) {
  const a = await act(action, given)
  if (!a.ok) tell(say(a.said))
  return a
}

// ---------------------------------------------------------------- muscle, circuit and rig
let drawn = ''
export function machine () {
  const s = setup()
  if (!s) return
  const free = shape() === 'idle'
  const key = JSON.stringify([s.muscle, s.muscles.length, s.rig, free, lab.parts.dry?.plumbing, lab.parts.laws?.title])
  if (key === drawn) return
  drawn = key
  const box = $('#muscle'); const scrolled = box.querySelector('.muscles')?.scrollTop ?? 0; const chose = box.contains(document.activeElement)
  if (free) {
    box.innerHTML = `<h2>Muscle <span class="faint plain">all drawn to one scale, at rest</span></h2><div role="radiogroup" aria-label="Muscle" class="muscles">${s.muscles.map(m => `<label class="sp"><input type="radio" name="muscle" value="${escape(m.id)}" ${m.id === s.muscle ? 'checked' : ''}><b title="${escape(m.title)}">${escape(brief(m))}</b><canvas aria-hidden="true"></canvas><span class="faint">${fmt(m.rest_length * 100, 1)}${TS}cm</span></label>`).join('')}</div>${s.biological.length ? `<p class="small faint living">Biological muscles are <a href="${escape(living(s.biological))}">on Compare</a>.</p>` : ''}`
    const longest = Math.max(...s.muscles.map(m => m.rest_length * 100))
    box.querySelectorAll('canvas').forEach((c, i) => small(c, s.muscles[i], 50 / longest, 68))
    uncover(box.querySelector('.muscles'), scrolled)
    if (chose) box.querySelector(':checked')?.focus({ preventScroll: true }) // the arrow keys go on
    box.querySelectorAll('input').forEach(i => { i.onchange = async () => { const a = await asks('muscle', { name: i.value }); if (!a.ok) { drawn = ''; machine() } } })
  } else {
    const m = s.muscles.find(m => m.id === s.muscle); const b = m.braid
    box.innerHTML = `<h2>${LOCK} Muscle</h2><div class="pick"><b>${escape(brief(m))}</b><canvas aria-hidden="true"></canvas><span class="small dim">Rest length ${fmt(m.rest_length * 100, 1)}${TS}cm${b ? `, thread ${fmt(b.thread_length * 100, 2)}${TS}cm${b.inferred ? ' <span class="faint">(inferred)</span>' : ''}, ${fmt(b.turns, 2)} turns` : ''}. ${escape(lab.parts.laws?.title ?? '')}</span></div>`
    small(box.querySelector('canvas'), m, Math.min(15.5, 220 / (m.rest_length * 100)), 258)
  }
  const c = $('#circuit')
  c.innerHTML = `<h2>${free ? '' : LOCK} Circuit and rig ${picture(s)}</h2>${s.machine ? `<p class="small">The real machine at <b>${escape(s.machine)}</b></p>` : ''}${free && !s.machine ? `<div class="field s"><select aria-label="Rig">${s.rigs.map(r => `<option value="${escape(r.name)}" ${r.name === s.rig ? 'selected' : ''}>${escape(r.title)}</option>`).join('')}</select></div>` : `<p class="small dim">${escape(s.rig_title)}.</p>`}`
  const select = c.querySelector('select')
  if (select) select.onchange = async () => { const a = await asks('rig', { name: select.value }); if (!a.ok) { drawn = ''; machine() } }
}
/** Scroll a list to where it was, or as much further as its selected entry needs. */
function uncover (list, scrolled) {
  const one = list.querySelector(':checked')?.closest('label')
  list.scrollTop = one ? clamp(scrolled, one.offsetTop + one.offsetHeight - list.clientHeight, one.offsetTop) : scrolled
}
const living = names => `/compare?muscles=${names.map(encodeURIComponent).join(',')}`
const brief = m => m.title.replace(/ of Chou and Hannaford$/, '').replace(/ muscle$/, '').replace(/^Festo (DMSP\S+) fluidic$/, '$1').replace(/^(Festo .*) fluidic(?: muscle, any rest length)?$/, '$1')
const picture = s => {
  const plumbing = lab.parts.dry?.plumbing ?? s.plumbing[0]
  return `<svg width="137" height="18" viewBox="0 0 258 34" role="img" aria-label="Supply, proportional valve, tube, muscle; plumbing ${escape(plumbing)}"><g fill="none" stroke="var(--ink)" stroke-width="1.200"><circle cx="12" cy="17" r="8"/><path d="M12 12l4 7H8z" fill="var(--ink)"/><path d="M20 17H54M102 17h24M218 17h14"/><rect x="54" y="8" width="24" height="18"/><rect x="78" y="8" width="24" height="18"/><path d="M58 22L74 12m0 0l-5 .500m5-.500l-2 4.500M90 26v-8m-4 0h8"/><path d="M126 17c6-10 10 10 16 0s10 10 16 0 10 10 16 0 10 10 16 0 10 10 16 0 6-5 12 0" stroke="var(--q-pressure)" stroke-width="2"/>${plumbing === 'accumulators' ? '<path d="M112 17v9"/><ellipse cx="112" cy="29" rx="8" ry="4"/>' : ''}<rect x="232" y="13" width="22" height="8" rx="3" fill="var(--sunken)"/></g></svg>`
}

// ---------------------------------------------------------------- protocol
let said = ''
export function protocol () {
  const p = lab.parts.protocol
  if (!p) return
  const free = idle(); const dry = lab.parts.dry ?? {}; const wrong = dry.cure?.name; const paths = new Set((dry.findings ?? []).map(f => f.path))
  const key = JSON.stringify([p.name, p.text, free, wrong, [...paths], p.known.length])
  if (key !== said && !$('#sent input')) { // what somebody types stays
    said = key
    const at = p.known.findIndex(k => k.name === p.name)
    $('#which').innerHTML = free ? `<div class="field s"><select aria-label="Protocol">${at < 0 ? `<option selected>${escape(p.title)}</option>` : ''}${p.known.map((k, i) => `<option value="${escape(k.name)}" ${i === at ? 'selected' : ''}>${escape(k.title)}</option>`).join('')}</select><span class="faint" style="white-space:nowrap">${at < 0 ? 'own' : `${at + 1} of ${p.known.length}`}</span></div>` : ''
    const select = $('#which select')
    if (select) select.onchange = () => asks('protocol', { name: select.value }).then(a => { if (!a.ok) { said = ''; protocol() } })
    sentence($('#sent'), free, wrong, paths)
  }
  const path = lab.status?.path ?? ''
  for (const li of document.querySelectorAll('#sent li')) {
    const on = path.startsWith(li.dataset.path) && Boolean(path)
    li.classList.toggle('on', on)
    if (on) li.setAttribute('aria-current', 'step'); else li.removeAttribute('aria-current')
  }
}
export function sentence (list, free, wrong, paths) {
  list.replaceChildren(...lab.parts.protocol.sentence.map(c => {
    const li = document.createElement('li'); li.dataset.path = c.path
    li.classList.toggle('wrong', paths.has(c.path))
    for (const piece of c.pieces) {
      if (!piece.name) { li.append(say(piece.text)); continue }
      const b = document.createElement('button')
      b.type = 'button'; b.dataset.name = piece.name; b.textContent = say(piece.text); b.className = piece.colour
      if (!free) b.setAttribute('aria-disabled', 'true')
      b.classList.toggle('wrong', piece.name === wrong)
      b.title = field(piece.name)?.about || piece.name
      b.setAttribute('aria-label', `${field(piece.name)?.label ?? piece.name}: ${piece.text}`)
      b.onclick = () => { if (free) edit(b, piece) }
      li.append(b)
    }
    li.append('.')
    return li
  }))
}
const field = name => lab.parts.protocol.form.find(f => f.name === name)
function edit (button, piece) {
  const f = field(piece.name)
  const input = document.createElement('input')
  input.value = f ? `${f.value}${f.unit && !f.value.includes(',') ? ` ${f.unit}` : ''}` : piece.text
  input.setAttribute('aria-label', f?.label ?? piece.name)
  input.style.width = `${Math.max(6, input.value.length + 2)}ch`
  button.replaceWith(input); input.focus(); input.select()
  let over = false
  const end = async (keep, back = false) => {
    if (over) return
    over = true
    if (keep && input.value !== button.textContent) {
      const a = await act('value', { name: piece.name, words: input.value })
      $('#refused').innerHTML = a.ok ? '' : `<div class="err">${SIGN}<span>${escape(say(a.said))}. The old value, ${escape(say(f ? `${f.value} ${f.unit}` : piece.text))}, stays in use.</span></div>`
    }
    back &&= document.activeElement === input // whoever has gone on to another number meanwhile types there
    if (input.isConnected) input.replaceWith(button)
    const list = button.closest('.sent')
    events.dispatchEvent(new CustomEvent('part', { detail: 'protocol' })) // draws what came meanwhile
    if (back) (button.isConnected ? button : list?.querySelector(`[data-name="${CSS.escape(piece.name)}"]`))?.focus()
  }
  input.onkeydown = e => { if (e.key === 'Enter') end(true, true); if (e.key === 'Escape') end(false, true) }
  input.onblur = () => end(true)
}

// ---------------------------------------------------------------- dry run
let checked = null; let of = null
export function dryRun () {
  const d = lab.parts.dry
  if (!d || !setup() || (d === checked && of === setup())) return
  checked = d; of = setup()
  const box = $('#dry')
  if (d.pending) { box.innerHTML = '<h2>Dry run <span class="faint plain">is being made</span></h2><div class="loading"><div class="line"><i></i></div></div>'; return }
  const rows = d.limits.map(l => {
    const k = factor(l.name); const over = l.peak > l.limit
    return `<span class="${Q[l.name].sign}">${Q[l.name].name}</span><span class="share ${Q[l.name].sign}"><i style="width:${Math.min(100, l.share * 100)}%"></i></span><span class="num ${over ? 'over' : ''}">${l.peak > FAR * l.limit ? `>${FAR}\u00d7` : fmt(l.peak * k, Q[l.name].places)} / ${fmt(l.limit * k, Q[l.name].limit)}${TS}${Q[l.name].unit}</span>`
  }).join('')
  const first = d.findings[0]
  // what does not prevent the run, but has to be known of it
  const cautions = (d.cautions ?? []).map(c => `<div class="note" role="note" style="margin-top:4px"><span>${escape(say(`${c[0].toUpperCase()}${c.slice(1)}${c.endsWith('?') ? '' : '.'}`))}</span></div>`).join('')
  box.innerHTML = `<h2 class="${d.passed ? '' : 'fails'}">Dry run ${d.passed ? 'passed' : 'fails'} <span class="faint plain">peaks against limits</span>${d.cure && idle() ? `<button class="btn s" id="cure">Use ${escape(say(d.cure.words))}</button>` : ''}</h2>${first ? `<div class="err" style="margin-top:4px">${SIGN}<span>${escape(say(first.sentence))}${d.cure ? `. ${escape(say(d.cure.sentence))}` : ''}</span></div>` : ''}${d.rigs?.length ? `<div class="rigs small"><span>Rigs that have it:</span>${d.rigs.map(r => `<button class="btn s" data-rig="${escape(r.name)}" title="${escape(r.title)}" ${idle() ? '' : 'disabled'}>${escape(r.name)}</button>`).join('')}</div>` : ''}${cautions}<div class="lim">${rows}</div>` // words first: a low window cuts what comes last
  const b = $('#cure')
  if (b) b.onclick = () => asks('cure')
  for (const one of box.querySelectorAll('[data-rig]')) one.onclick = () => asks('rig', { name: one.dataset.rig })
}

// ---------------------------------------------------------------- by hand
const sliders = new Map()
const SET = { pressure: 'pressure', length: 'length' }
export function hand (now) {
  const s = setup()
  if (!s) return
  const box = $('#sliders'); const status = lab.status ?? {}
  const of = `${s.rig}/${s.muscle}/${lab.parts.laws?.free}`
  if (box.dataset.of !== of) {
    box.dataset.of = of; box.replaceChildren(); sliders.clear()
    for (const q of ['pressure', ...(s.has_motor ? ['length'] : [])]) slider(box, q, ends(s, q))
  }
  const state = shape()
  const off = !['idle', 'running'].includes(state) || (state === 'running' && !status.set_points)
  const words = off ? { running: 'the protocol holds these', paused: 'the protocol holds these', tripped: 'locked until reset', lost: 'no connection' }[state] : !mine() ? 'you watch' : status.by_hand !== 'ready' ? say(status.by_hand ?? '') : 'ready'
  if ($('#manual-state').textContent !== words) $('#manual-state').textContent = words
  $('#vent').disabled = off || !status.set_points
  for (const [q, one] of sliders) one.show(Number.isFinite(lab.status?.at?.[q]) ? lab.status.at[q] * factor(q) : now[q], asked(q, now), off || !mine() || status.by_hand !== 'ready')
}
function asked (q, now) {
  const points = lab.status?.set_points; const at = lab.status?.at?.[q] // of the machine by hand, whatever the page shows of a run
  if (points) { const v = points[q === 'length' ? 'span' : q]; if (Number.isFinite(v)) return v * factor(q) }
  if (Number.isFinite(at)) return at * factor(q)
  const set = now[`set_${q}`]
  return Number.isFinite(set) && shape() !== 'idle' ? set : now[q]
}
function ends (s, q) {
  const k = factor(q); const [a, b] = s.limits[q].map(v => v * k)
  if (q !== 'length') return [a, b]
  const laws = lab.parts.laws; const rest = s.rest_length * k
  // what the muscle can reach, within what the frame allows
  return [Math.max(a, laws ? Math.floor(laws.free * k * 2) / 2 : rest * 0.6), Math.min(b, laws ? Math.round(laws.longest * k * 1.013 * 10) / 10 : rest * 1.12)]
}
function slider (box, q, [low, high]) {
  const step = q === 'pressure' ? 0.05 : 0.05; const unit = Q[q].unit
  const one = document.createElement('div'); one.className = `slider ${Q[q].sign}`
  one.innerHTML = `<div class="lab"><span>${keySign(q)}${Q[q].name} set-point</span><span class="faint">${fmt(low, 1)} to ${fmt(high, 1)}${TS}${unit}</span></div><div class="tr"><i></i><input type="range" min="${low}" max="${high}" step="${step}" aria-label="${Q[q].name} set-point, ${unit}"></div><div class="field s"><input inputmode="decimal" aria-label="${Q[q].name} set-point"><span class="u">${unit}</span></div><div class="err" hidden></div>`
  box.append(one)
  const bar = one.querySelector('i'); const range = one.querySelector('[type=range]'); const number = one.querySelector('.field input'); const edge = one.querySelector('.field'); const err = one.querySelector('.err')
  let held = false; let due = null
  const refuse = text => { err.hidden = !text; edge.classList.toggle('bad', Boolean(text)); number.setAttribute('aria-invalid', String(Boolean(text))); err.innerHTML = text ? `${SIGN}<span>${escape(say(text))}</span>` : '' }
  const ask = async words => { const a = await act('set', { [SET[q]]: words }); refuse(a.ok ? '' : a.said) }
  range.oninput = () => {
    number.value = (+range.value).toFixed(2)
    due ??= setTimeout(() => { due = null; ask(`${range.value} ${unit}`) }, 60)
  }
  range.onpointerdown = () => { held = true }
  range.onchange = range.onpointerup = range.onpointercancel = () => { held = false } // a click on the thumb changes nothing
  range.onkeydown = e => {
    const by = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 }[e.key]
    if (by && e.shiftKey) { e.preventDefault(); range.value = String(clamp(+range.value + by * 10 * step, low, high)); range.oninput() }
  }
  number.onchange = () => { const text = number.value.trim().replace('\u2212', '-'); ask(/^[-+.\d]+$/.test(text) ? `${text} ${unit}` : text) }
  const show = (value, point, off) => {
    bar.style.width = `${clamp((value - low) / (high - low), 0, 1) * 100}%`
    one.classList.toggle('off', off)
    if (range.disabled !== off) { range.disabled = off; number.disabled = off }
    if (held || due || !err.hidden) return
    const v = Number.isFinite(point) ? point : low
    if (Math.abs(+range.value - v) > step / 2) range.value = String(clamp(v, low, high))
    const text = v.toFixed(2)
    if (number.value !== text && document.activeElement !== number) number.value = text
  }
  sliders.set(q, { show })
}
$('#vent').onclick = () => asks('vent')

// ---------------------------------------------------------------- the link
// What a link asks for waits this long [ms] for the controls, which the page that vanished before this one holds for 6 s.
const WAITS = 10000
const query = new URLSearchParams(location.search)
const edits = () => { const e = lab.parts.protocol?.edits; return e && Object.keys(e).length ? JSON.stringify(e) : '' }
const chosen = () => ({ muscle: setup()?.muscle, rig: setup()?.rig, protocol: lab.parts.protocol?.name, values: edits() })
lab.missing = () => lab.parts.protocol?.edits === null ? ' The text of this protocol is not in it: save it under a name, then copy the link.' : ''
const valuesOf = text => { try { const v = JSON.parse(text); return v && typeof v === 'object' ? Object.entries(v) : [] } catch { return [] } }
let since = null
let want = Object.fromEntries(['muscle', 'rig', 'protocol', 'values'].map(k => [k, query.get(k)]).filter(([, v]) => v))
export function fromLink () {
  if (!want || !setup() || !lab.parts.protocol || !lab.status) return
  since ??= performance.now()
  const have = chosen()
  if (setup().biological.includes(want.muscle)) {
    const said = `${want.muscle} is a biological muscle, which has no valve: it is stimulated on the page Compare.`
    tell(said, 60, { words: 'Compare', address: living([want.muscle]) })
    delete want.muscle
  }
  const differ = Object.entries(want).filter(([k, v]) => v !== have[k])
  if (differ.length && (!mine() || shape() !== 'idle') && performance.now() - since < WAITS) return
  want = null
  if (mine() && shape() === 'idle') take(differ)
  else {
    const words = differ.map(([k, v]) => k === 'values' ? valuesOf(v).map(p => p.join(' ')).join(', ') : `${k} ${v}`).join(', ')
    if (differ.length) tell(`The link's ${words} was not chosen: ${mine() ? 'the machine is not idle' : 'this page is not in control'}.`, 20)
    link(have)
  }
}
/** Choose what a link says, one after the other; its numbers are those of its protocol. */
async function take (differ) {
  taking = true
  for (const [k, v] of differ) {
    if (k !== 'values') { if (!(await asks(k, { name: v })).ok && k === 'protocol') break } else for (const [name, words] of valuesOf(v)) await asks('value', { name, words: String(words) })
  }
  taking = false
  if (!want) link(chosen())
}
let taking = false
events.addEventListener('part', () => {
  fromLink()
  if (!want && !taking) link(chosen())
})
events.addEventListener('status', fromLink)
