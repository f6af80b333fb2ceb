// The page Bench: the machine, its waveforms, its numbers, and everything that is done to it.
import { Buffer, NAMES } from './buffer.js'
import './edit.js'
import { act, emergency, events, key, lab, link, rate, shape, tell } from './lab.js'
import { LoopPlot } from './loop.js'
import { Measured } from './measured.js'
import { braid, drawStage } from './muscle.js'
import { asks, dryRun, hand, idle, machine, mine, protocol } from './setup.js'
import { Strips } from './strips.js'
import { Q, TS, clamp, escape, fmt, keySign, row, say, token } from './words.js'

const $ = s => document.querySelector(s)
const phone = () => innerWidth <= 760
const buffer = new Buffer()
const strips = new Strips($('#strips'), buffer)
const loop = new LoopPlot($('#fl'), buffer)
let factors = {}; let seen = { high: {}, low: {} }; let end = 0; let mode = 'dry'; let dry = null; let shownDry = null
let zoom = +(new URLSearchParams(location.search).get('window') ?? 6) || 6
zoom = clamp(zoom, 0.05, 120)

// ---------------------------------------------------------------- what is shown
const status = () => lab.status ?? {}
const epochOf = () => lab.epoch ?? { epoch: 0, period: 1e-3, kind: 'none' }
const muscle = () => lab.parts.setup?.muscles.find(m => m.id === lab.parts.setup.muscle)
function choose () {
  const s = shape(); const has = buffer.n > 0 && buffer.epoch === epochOf().epoch
  if (status().moving && has) return 'live'
  if (s === 'lost' && has) return mode
  if (has && status().ended?.duration && epochOf().kind === 'run' && shownDry === dry) return 'done'
  if (s === 'tripped' && has) return 'done'
  return 'dry'
}
function now () {
  const found = {}
  if (mode !== 'dry' && buffer.n) for (const n of NAMES) found[n] = buffer.latest(n)
  else { // of the machine as it stands, not of what was sampled before; a run that has no sample yet begins as its dry run does
    const m = muscle(); const at = status().at ?? {}
    Object.assign(found, { pressure: 0, tension: 0, length: m ? m.rest_length * 100 : 0, flow: 0, valve: 0, set_pressure: NaN, set_length: NaN })
    for (const n of NAMES) if (Number.isFinite(at[n])) found[n] = at[n] * (factors[n.replace('set_', '')] ?? 1)
    if (status().running) for (const n of Object.keys(Q)) if (Number.isFinite(dry?.[n]?.[0])) found[n] = dry[n][0]
  }
  if (mode === 'live' && Number.isFinite(strips.cursor) && strips.cursor !== null && status().paused) found.at = strips.cursor
  return found
}
events.addEventListener('epoch', () => { strips.dirty = loop.dirty = true; seen = { high: {}, low: {} } })
events.addEventListener('frame', e => {
  const f = e.detail; const period = epochOf().epoch === f.epoch ? epochOf().period : 1e-3
  if (f.server !== buffer.server || f.epoch !== buffer.epoch) { strips.ranges = {}; fresh = true; begun = f.first * period }
  buffer.add(f, factors, period)
  strips.dirty = loop.dirty = true
})
events.addEventListener('restart', () => {
  buffer.clear('', 0, 1e-3); $('#log').replaceChildren(); $('#said').replaceChildren()
  Object.assign(strips, { ranges: {}, held: null, cursor: null, pinned: false, dirty: true })
  seen = { high: {}, low: {} }; extremes = {}; dry = shownDry = loop.dry = null; end = 0; fresh = true; loop.dirty = true
})
let fresh = true; let begun = 0; let extremes = {}; let of = null
const due = () => mode === 'dry' && Boolean(lab.parts.dry?.pending) // the dry run that is drawn is not of what is chosen now
events.addEventListener('part', e => {
  const part = lab.parts[e.detail]
  if (e.detail === 'setup') { factors = Object.fromEntries(Object.entries(part.units).map(([n, u]) => [n, u.factor])); limits(); if (lab.parts.dry && !lab.parts.dry.pending) expected(lab.parts.dry) }
  if (e.detail === 'laws') { loop.laws = part; loop.plotted = false; loop.dirty = true }
  if (e.detail === 'dry' && !part.pending) { expected(part); own.again(); of = lab.parts.setup?.muscle }
  else if (lab.parts.dry?.pending && of !== lab.parts.setup?.muscle) { // what the former muscle would do says nothing of this one
    of = lab.parts.setup?.muscle; expected({})
    if (e.detail !== 'laws') loop.laws = null
  }
  machine(); protocol(); dryRun(); strips.dirty = loop.dirty = true
})
function limits () {
  const s = lab.parts.setup
  strips.limits = { pressure: s.limits.pressure[1] * factors.pressure, tension: s.limits.tension[1] * factors.tension, length: s.limits.length[1] * factors.length }
  loop.rest = s.rest_length * 100
}
function expected (part) {
  const c = part.curves ?? {}
  dry = c.time
    ? { time: c.time, lane: part.lane, ...Object.fromEntries(Object.keys(Q).filter(q => c[q]).map(q => [q, c[q].map(v => v === null ? null : v * (factors[q] ?? 1))])) }
    : null
  if (!lab.status?.ended?.duration || epochOf().kind !== 'run') shownDry = dry
  if (mode === 'dry') strips.ranges = {}
  const cycle = dry?.lane?.find(s => s.period) // one cycle of many, else dashes that lie over each other become a line
  const inside = t => !cycle || (t >= cycle.start + cycle.period * 0.999 && t <= cycle.start + cycle.period * 2.001) || cycle.end < cycle.start + 2 * cycle.period
  const some = dry?.tension && dry.length ? dry.time.map((t, i) => i).filter(i => inside(dry.time[i])) : []
  extremes = {}
  for (const q of Object.keys(Q)) {
    let low = Infinity; let high = -Infinity
    for (const v of dry?.[q] ?? []) if (v !== null) { if (v < low) low = v; if (v > high) high = v }
    extremes[q] = [low, high]
  }
  loop.reach = extremes.length
  loop.dry = some.length ? { length: some.map(i => dry.length[i]), tension: some.map(i => dry.tension[i]) } : null
}

// ---------------------------------------------------------------- every frame
let last = 0; let slow = 0; let drawnOnce = false
const show = () => { drawnOnce = true; $('main.bench').classList.add('drawn'); numbers() }
setTimeout(() => { if (!drawnOnce) show() }, 2000) // whatever is missing: a page that operates a machine does not stay blank
function frame (t) {
  requestAnimationFrame(frame)
  const dt = Math.min(0.1, (t - last) / 1000); last = t
  const was = mode
  mode = choose()
  if (mode !== was) { strips.dirty = loop.dirty = true; if (mode === 'dry') strips.ranges = {}; if (mode === 'live' || mode === 'dry') { strips.held = null; strips.zoomer.range = null } }
  const live = mode === 'live' && lab.open
  if (live) {
    const gap = buffer.end - end
    end = Math.abs(gap) > 0.6 || status().paused || fresh ? buffer.end : end + clamp(gap, 0, 1) * Math.min(1, dt * 12)
    fresh = false
    if (Math.abs(gap) > 1e-6) strips.dirty = true
  } else end = buffer.end
  if (strips.dirty) paint()
  if (!drawnOnce && strips.total && lab.parts.dry && (lab.parts.laws || !lab.parts.dry.pending)) show() // all at once, so that nothing moves
  if (t - slow > 100) { slow = t; numbers() }
}
function paint () {
  const tripped = trip()
  const source = mode === 'dry' ? dry : null
  strips.source = source; strips.trip = tripped; strips.old = due() || (!lab.open && mode !== 'dry'); strips.zoom = zoom; strips.done = mode !== 'live'
  if (strips.held) strips.view = strips.held
  else if (mode === 'dry') strips.view = { a: 0, b: zoom }
  else if (tripped && !status().running) strips.view = { a: Math.max(0, tripped.time - 0.9), b: Math.max(tripped.time + 0.5, Math.min(buffer.end, tripped.time + 0.6)) }
  else { const t0 = buffer.first ? Math.max(0, begun) : 0; strips.view = end - t0 < zoom ? { a: t0, b: t0 + zoom } : { a: end - zoom, b: end } }
  strips.lanes = mode === 'dry' ? dry?.lane : epochOf().kind === 'run' ? status().steps ?? status().ended?.steps : []
  for (const q of Object.keys(Q)) ends(q)
  if (own?.data?.t) residuals()
  strips.draw()
  strips.showWhen()
  loop.live = mode !== 'dry'; loop.old = strips.old; loop.cursor = strips.cursor; loop.end = mode === 'live' ? Math.min(end, buffer.end) : buffer.end
  const step = strips.lanes?.at(-1)
  const cycles = mode !== 'dry' && [...(strips.lanes ?? [])].reverse().find(s => s.period)
  loop.period = cycles ? cycles.period : 0; loop.from = cycles ? cycles.start : 0
  if (cycles && step !== cycles && cycles.end) loop.end = Math.min(loop.end, cycles.end)
  loop.work = (status().measured ?? status().ended?.measured ?? []).find(m => m.unit === 'J')?.value ?? null
  loop.words = shape() === 'tripped' ? 'last whole cycle' : 'last cycle'
  const top = Math.max(dryTop('tension'), buffer.high.tension ?? 0, own.extremes('tension')?.[1] ?? 0, 10)
  loop.fit(top, strips.limits.tension ?? 100)
  if (visible('#fl')) loop.draw()
  picture()
}
const visible = s => $(s).offsetParent !== null
const dryTop = q => Math.max(0, extremes[q]?.[1] ?? 0)
function ends (q) {
  let low = Infinity; let high = -Infinity
  const take = v => { if (v !== null && Number.isFinite(v)) { if (v < low) low = v; if (v > high) high = v } }
  if (mode === 'dry' || epochOf().kind === 'run') for (const v of extremes[q] ?? []) take(v)
  for (const v of own?.extremes(q) ?? []) take(v)
  if (mode !== 'dry') { take(buffer.low[q]); take(buffer.high[q]); if (q === 'length' || q === 'pressure') { take(buffer.low[`set_${q}`]); take(buffer.high[`set_${q}`]) } }
  strips.range(q, low, high)
}
function residuals () {
  const [i, j] = own.between(strips.view.a, strips.view.b); let low = Infinity; let high = -Infinity
  for (let k = i; k < j; k++) { const r = own.left('tension', k); if (r < low) low = r; if (r > high) high = r }
  strips.range('residual', low, high)
}
function picture () {
  const m = muscle(); const place = $('#stage')
  if (!m || !place.offsetParent) return
  const shown = now(); const c = strips.cursor; const at = c !== null && (status().paused || mode !== 'live') && Number.isFinite(strips.value('length', c)) ? Object.fromEntries(Object.keys(Q).map(q => [q, strips.value(q, c)])) : shown
  if (!Number.isFinite(at.valve)) at.valve = 0
  if (!Number.isFinite(at.tension)) at.tension = 0
  const range = Number.isFinite(extremes.length?.[0]) && !due() && (mode === 'dry' || epochOf().kind === 'run') ? extremes.length : null
  drawStage(place.querySelector('canvas'), place.clientWidth, phone(), { muscle: m, now: at, told: at === shown ? strips.told ?? at : at, limits: { pressure: strips.limits.pressure, tension: strips.limits.tension }, range: range && range[1] - range[0] > 0.01 ? range : null, dry: mode === 'dry' })
}
function trip () {
  const s = status()
  if (mode === 'dry' || !(shape() === 'tripped' || s.ended?.stopped)) return null
  const time = s.trip ?? s.ended?.trip
  if (!Number.isFinite(time)) return null
  const why = s.why || s.ended?.why || '' // a reset changes nothing of what ended the run
  const quantity = /pressure/.test(why) ? 'pressure' : /tension|force/.test(why) ? 'tension' : ''
  return { time, quantity: /emergency/.test(why) ? '' : quantity, word: /emergency/.test(why) ? 'stop' : 'trip' }
}

// ---------------------------------------------------------------- ten times a second
const READ = [['pressure', 0, 7], ['tension', 0, 110], ['length', 10, 16]]
function numbers () {
  const told = now()
  const changed = mode === 'dry' // beside a dry run only the two numbers in the drawing are of the machine
    ? ['length', 'valve'].some(q => fmt(told[q], 2) !== fmt(strips.told?.[q], 2))
    : Object.keys(Q).some(q => told[q] !== strips.told?.[q])
  if (changed) strips.dirty = true
  strips.told = told
  runBar(); banner(); reads(); protocol(); hand(strips.told); measured(); own.numbers(); buttons()
  document.documentElement.classList.toggle('old', !lab.open && Boolean(lab.status))
  const late = strips.frames; strips.frames = 0
  drawn.push(late); if (drawn.length > 10) drawn.shift()
  const fps = drawn.reduce((a, b) => a + b, 0)
  rate(mode === 'live' && lab.open ? `${Math.min(60, fps)}${TS}frames/s \u00b7 ${fmt(1e-3 / epochOf().period, epochOf().period < 2e-3 ? 0 : 1)}${TS}kHz` : '')
  const label = `The muscle on the machine, drawn to scale: ${spoken()}`
  const c = $('#stage canvas')
  if (c.getAttribute('aria-label') !== label) c.setAttribute('aria-label', label)
  if ($('details.values').open) table()
}
const drawn = []
function spoken () {
  const n = now(); const m = muscle(); const b = m ? braid(m, n.length) : {}
  return `length ${fmt(n.length, 2)} cm, diameter ${fmt(b.diameter, 2)} cm, braid angle ${fmt(b.angle, 1)} degrees, pressure ${fmt(n.pressure, 2)} bar, tension ${fmt(n.tension, 1)} N`
}
const CUTS = 400 // of the bar of a run, beyond which they would cover it
function put (e, text) { if (e.textContent !== text) e.textContent = text }
function runBar () {
  const s = status(); const d = lab.parts.dry ?? {}; const title = s.title ?? lab.parts.protocol?.title ?? ''
  const of = s.running ? s : mode === 'done' ? s.ended : d // where a test may end a step the time is the longest
  const total = (mode === 'done' && s.ended?.by === '' && s.ended.at_most ? s.ended.time : of?.duration) ?? 0; const most = of?.at_most && mode !== 'done' ? 'at most ' : ''
  const time = mode === 'dry' ? 0 : epochOf().kind === 'hand' ? buffer.end : s.running ? s.time : s.ended?.time ?? s.time
  put($('#clk'), fmt(time ?? 0, 3))
  const cycles = s.cycle?.length ? s.words : s.words ?? ''
  let left = title; let right = total ? `${most || ''}${fmt(total, 1)}${TS}s${most ? '' : ' in all'}` : ''
  if (s.name === 'By hand') { left = 'By hand'; right = '' } else if (s.running) {
    left = `${title} \u00b7 ${s.paused ? `paused in ${cycles}` : cycles}`
    right = `${most}${fmt(Math.max(0, total - s.time), 1)}${TS}s left of ${fmt(total, 1)}${TS}s`
  } else if (shape() === 'tripped' && epochOf().kind === 'hand') { left = `By hand \u00b7 ${s.vented ? 'ended by the emergency stop' : 'ended by an interlock'}`; right = '' } else if (mode === 'done') { left = `${s.ended?.title ?? title} \u00b7 ${s.ended?.by ? `ended by ${s.ended.by}` : 'ended'}`; right = s.ended?.file ? 'recorded and kept' : 'nothing was recorded' }
  put($('#pl'), left); put($('#pr'), right)
  const share = total && (s.running || epochOf().kind === 'run') && mode !== 'dry' ? clamp((time ?? 0) / total, 0, 1) : 0
  const key = [share.toFixed(3), total, shape() === 'tripped', d === lab.parts.dry].join()
  if ($('#prog').dataset.key !== key) {
    $('#prog').dataset.key = key; $('#prog').setAttribute('aria-valuenow', String(Math.round(share * 100)))
    const cuts = []
    for (const one of d.lane ?? []) if (cuts.length < CUTS) cuts.push(one.start, ...((one.end - one.start) / one.period < 120 ? row(one.start + one.period, one.period, one.end - 1e-6) : []))
    $('#prog').innerHTML = `<svg height="10" viewBox="0 0 1000 10" preserveAspectRatio="none" aria-hidden="true"><rect y="2" width="1000" height="6" fill="var(--sunken)"/><rect y="2" width="${share * 1000}" height="6" fill="var(${shape() === 'tripped' ? '--stop' : '--ink'})"/>${total ? cuts.map(t => `<path d="M${(t / total * 1000).toFixed(1)} 0v10" stroke="var(--panel)" stroke-width="2"/>`).join('') : ''}</svg>`
  }
  for (const b of document.querySelectorAll('#pace button')) { const on = String(b.dataset.pace === s.pace); if (b.getAttribute('aria-pressed') !== on) b.setAttribute('aria-pressed', on) }
  $('#pace').hidden = real()
}
const real = () => !!lab.parts.setup?.machine // it has its own time
let shownButtons = ''
function buttons () {
  const s = shape(); const st = status(); const may = mine()
  const ready = lab.parts.dry?.passed === true
  const key = [s, ready, may, st.ended?.file, st.running, st.asked, real()].join()
  if (key === shownButtons) return
  shownButtons = key
  const off = on => on ? '' : 'disabled'
  const start = (on, primary) => `<button class="btn ${primary ? 'pri' : ''}" id="start" ${off(on)} ${primary ? 'style="padding:0 26px"' : ''}>Start <kbd>Enter</kbd></button>`
  const open = st.ended?.file ? `<a class="btn" href="/recordings?a=${encodeURIComponent(st.ended.file)}">Open recording</a>` : ''
  const sets = {
    idle: `${start(may && ready, true)}<button class="btn" disabled>Pause</button><button class="btn" id="stop" disabled>Stop</button>`,
    running: st.running ? `${start(false)}<button class="btn pri" id="pause" ${off(may && !real())}>Pause <kbd>Space</kbd></button><button class="btn" id="stop">Stop <kbd>S</kbd></button>` : `${start(may && ready, true)}<button class="btn" disabled>Pause</button><button class="btn" id="stop">Vent <kbd>S</kbd></button>`,
    paused: `<button class="btn pri" id="resume" ${off(may)}>${st.asked ? 'Done' : 'Resume'} <kbd>Space</kbd></button><button class="btn" id="step" ${off(may && !st.asked && !real())}>Step 1${TS}ms</button><button class="btn" id="stop">Stop <kbd>S</kbd></button>`,
    tripped: `<button class="btn pri" id="reset" ${off(may && !st.running)}>Reset</button>${start(false)}${open}`,
    lost: `${start(false)}<button class="btn" disabled>Pause</button><button class="btn" disabled>Stop</button>`
  }
  $('#btns').innerHTML = sets[s]
  for (const [id, action] of [['start', 'start'], ['pause', 'pause'], ['resume', 'resume'], ['stop', 'stop'], ['step', 'step'], ['reset', 'reset']]) { const b = $(`#btns #${id}`); if (b) b.onclick = () => asks(action) }
  const [word, action] = { idle: ['Start', 'start'], running: st.running ? ['Pause', 'pause'] : ['Start', 'start'], paused: [st.asked ? 'Done' : 'Resume', 'resume'], tripped: ['Reset', 'reset'], lost: ['Start', null] }[s]
  put($('#phb'), word); $('#phb').disabled = !may || !action || (word === 'Pause' && real()) || (word === 'Start' && !ready); $('#phb').onclick = () => asks(action)
  $('#phs').disabled = !(s === 'running' || s === 'paused'); $('#phs').onclick = () => asks('stop')
}
for (const b of document.querySelectorAll('#pace button')) b.onclick = () => asks('pace', { name: b.dataset.pace })

let shownBanner = ''
function banner () {
  const s = status(); const state = shape()
  let html = ''
  if (state === 'lost' && lab.status) html = `<div class="note" role="alert" style="font-size:13px;padding:11px 16px"><span><b>This page lost the connection to the server at ${fmt(lab.lost ?? s.time, 3)}${TS}s.</b> ${s.running ? 'The run goes on there, with its interlocks. What you miss is fetched when the line is back.' : 'It comes back by itself.'} Until then this page cannot stop it: <b>use the button on the machine.</b> Grey values are old.</span></div>`
  else if (state === 'tripped') {
    const [first, ...rest] = tripWords(s.why)
    html = `<div class="banner" role="alert"><svg width="24" height="24" viewBox="0 0 28 28" aria-hidden="true"><path d="M9 2h10l7 7v10l-7 7H9l-7-7V9z" fill="var(--stop)"/><path d="M14 7v9M14 18.500v3" stroke="var(--on-stop)" stroke-width="3"/></svg><p class="grow"><b>${escape(say(first))}</b> ${escape(say(rest.join(' ')))}${s.ended?.file && s.ended.stopped ? ' The recording up to here is kept.' : ''}</p><button class="btn" id="led">What led to it</button></div>`
  } else if (s.asked) html = `<div class="note" role="alert"><span><b>${escape(say(`Please ${s.asked}`))}</b>, then press Done.</span></div>`
  if (html === shownBanner) return
  shownBanner = html
  $('#ban').innerHTML = html
  const led = $('#led')
  if (led) led.onclick = () => { const t = trip(); if (t) { strips.held = { a: Math.max(0, t.time - 3), b: t.time + 0.5 }; strips.zoomer.range = { x: [strips.held.a, strips.held.b] }; strips.cursor = t.time; strips.pinned = true; strips.dirty = true } }
}
const tripWords = why => { const text = why[0]?.toUpperCase() + why.slice(1); const i = text.search(/[;.](?!\d)/); return i < 0 ? [`${text}.`] : [`${text.slice(0, i)}.`, cap(text.slice(i + 1).trim()) + (/\.$/.test(text) ? '' : '.')] }
const cap = t => t ? t[0].toUpperCase() + t.slice(1) : ''

function reads () {
  const setup = lab.parts.setup
  if (!setup) return
  const n = strips.told; const m = muscle(); const run = mode !== 'dry'
  const rest = m.rest_length * 100; const L = strips.ranges.length ?? [rest * 0.7, rest * 1.1]
  const spans = { pressure: [0, strips.limits.pressure * 1.16], tension: [0, strips.limits.tension * 1.1], length: [Math.min(L[0], rest * 0.7), Math.max(L[1], rest * 1.12)] }
  const box = $('#reads')
  if (!box.children.length) box.innerHTML = READ.map(([q]) => `<div class="read" data-q="${q}"><span class="nm ${Q[q].sign}">${keySign(q)}${Q[q].name}<span class="word"></span></span><span class="set"></span><span class="big ${Q[q].sign}"><span class="val"></span><span class="u">${Q[q].unit}</span></span><svg class="an" height="15" viewBox="0 0 340 15" preserveAspectRatio="none" aria-hidden="true"></svg></div>`).join('')
  for (const [q] of READ) {
    const e = box.querySelector(`[data-q=${q}]`); const [a, b] = spans[q]; const v = n[q]; const limit = strips.limits[q]; const set = q === 'tension' ? NaN : n[`set_${q}`]
    const low = run ? buffer.low[q] : NaN; const high = run ? buffer.high[q] : NaN
    put(e.querySelector('.val'), fmt(v, Q[q].places))
    put(e.querySelector('.word'), v > limit ? 'over range' : q === 'tension' && run && v < 0.2 && n.pressure < 0.05 ? 'slack' : mode === 'done' ? 'last sample' : '')
    let words = status().running ? 'at its start' : real() ? 'now' : n.pressure < 0.05 ? 'at rest' : 'held'
    const lim = `limit ${fmt(limit, Q[q].limit)}`
    if (run) words = q === 'pressure' ? (Number.isFinite(set) ? `set ${fmt(set, 2)} \u00b7 ${lim}` : lim) : q === 'tension' ? `peak ${fmt(high, 1)} \u00b7 ${lim}` : `seen ${fmt(low, 2)} to ${fmt(high, 2)} \u00b7 ${lim}`
    if (run && shape() === 'tripped' && q === 'pressure') words = `highest ${fmt(high, 2)} \u00b7 ${lim}`
    put(e.querySelector('.set'), words)
    bar(e.querySelector('.an'), q, v, a, b, run && shape() !== 'tripped' ? set : NaN, low, high, limit)
  }
  const g = braid(m, n.length)
  const minis = [['q', 'Flow', fmt(n.flow, 1), 'L/min'], ['v', 'Valve', fmt(n.valve, 0), '%'], ['', 'Angle \u03b8', fmt(g.angle, 1), '\u00b0'], ['', 'Contraction', fmt((rest - n.length) / rest * 100, 1), '%']]
  const box2 = $('#minis')
  if (!box2.children.length) box2.innerHTML = minis.map(i => `<div><span class="${i[0]}" style="${i[0] ? 'font-weight:600' : ''}">${i[1]}</span><b><span class="n"></span><span class="u">${TS}${i[3]}</span></b></div>`).join('')
  minis.forEach((i, k) => put(box2.children[k].querySelector('.n'), i[2]))
}
function bar (svg, q, v, a, b, set, low, high, limit) {
  const X = u => (2 + (clamp(u, a, b) - a) / (b - a) * 336).toFixed(1)
  const c = `var(--q-${q})`; const show = limit < b
  const html = `<rect x="2" y="5" width="336" height="5" fill="var(--sunken)"/>${Number.isFinite(low) ? `<rect x="${X(low)}" y="5" width="${Math.max(0, X(high) - X(low))}" height="5" fill="${c}" opacity=".28"/>` : ''}<rect x="2" y="5" width="${Math.max(0, X(v) - 2) || 0}" height="5" fill="${c}"/>${Number.isFinite(set) ? `<path d="M${X(set)} 12v-9" stroke="var(--ink)" stroke-width="2"/>` : ''}${show ? `<path d="M${X(limit)} 1v13" stroke="var(--ink)" stroke-width="1"/><path d="M${X(limit)} 7.500H338" stroke="var(--ink)" stroke-width="5" stroke-dasharray="2 3" opacity=".5"/>` : ''}`
  if (svg.dataset.was !== html) { svg.dataset.was = html; svg.innerHTML = html }
}
let shownMeasured = null
function measured () {
  const s = status(); const list = s.measured ?? s.ended?.measured ?? []
  const kind = mode === 'dry' ? 'dry' : 'run'; const key = JSON.stringify([kind, list, lab.parts.dry?.passed, loop.laws?.lines.length])
  if (key === shownMeasured) return
  shownMeasured = key
  // before a run what is expected, then what was measured; a protocol that does not pass says so in either case
  $('#meas').hidden = kind === 'dry'
  $('#dry').hidden = kind === 'run' && lab.parts.dry?.passed === true
  const rows = list.map(m => [m.name, `${fmt(m.value, m.places)}${TS}${m.unit}`])
  $('#meas').innerHTML = `<h2>Measured on the last cycle</h2>${rows.length ? `<dl class="meas">${rows.map(([n, v]) => `<dt>${escape(n)}</dt><dd>${v}</dd>`).join('')}</dl>` : '<p class="small faint">Nothing yet: a cycle has to end first.</p>'}`
  $('.plotc .cap')?.remove()
  $('.plotc').insertAdjacentHTML('afterbegin', `<div class="cap"><span><b class="F">Tension</b>, N, against <b class="L">length</b>, cm</span><span class="faint">law${loop.laws?.lines.length ? `: 1 to ${loop.laws.lines.length}${TS}bar` : ''}</span></div>`)
}
function table () {
  const { a, b } = strips.view; const rows = []; const order = Object.keys(Q)
  for (let i = 0; i <= 60; i++) {
    const t = a + (b - a) * i / 60; const values = order.map(q => strips.value(q, t))
    if (values.some(Number.isFinite)) rows.push(`<tr><td class="num">${fmt(t, 3)}</td>${values.map((v, k) => `<td class="num">${fmt(v, Q[order[k]].places)}</td>`).join('')}</tr>`)
  }
  $('#values').innerHTML = `<table><thead><tr><th class="num">Time, s</th>${order.map(q => `<th class="num">${Q[q].name}, ${Q[q].unit}</th>`).join('')}</tr></thead><tbody>${rows.join('')}</tbody></table>`
}

// ---------------------------------------------------------------- log and console
const SIGNS = {
  note: '<svg width="10" height="10" aria-label="note"><circle cx="5" cy="5" r="3" fill="var(--edge)"/></svg>', done: '<svg width="11" height="10" aria-label="done"><path d="M1 5l3 3 6-7" fill="none" stroke="var(--ink)" stroke-width="1.800"/></svg>',
  caution: '<svg width="12" height="11" aria-label="caution"><path d="M6 1l5.500 9.500H.500z" fill="var(--caution-edge)"/></svg>', stop: '<svg width="12" height="12" aria-label="stop"><path d="M4 0h4l4 4v4l-4 4H4L0 8V4z" fill="var(--stop)"/></svg>'
}
events.addEventListener('log', e => {
  const list = $('#log')
  for (const m of e.detail) {
    const li = document.createElement('li')
    li.innerHTML = `<span class="faint num">${m.time === null ? '' : fmt(m.time, 3)}</span>${SIGNS[m.kind] ?? SIGNS.note}<span></span>`
    li.lastChild.textContent = say(m.text)
    list.prepend(li)
  }
  while (list.children.length > 200) list.lastChild.remove()
  // whoever hears the page hears what was done and what to mind; a stop is said by its banner, and cycles are not counted aloud
  const news = e.detail.filter(m => m.kind === 'done' || m.kind === 'caution')
  if (news.length) put($('#heard'), news.map(m => say(m.text)).join(' '))
})
const lines = []; let back = 0
$('#ask').onsubmit = async e => {
  e.preventDefault()
  const line = $('#line').value.trim()
  if (!line) return
  $('#line').value = ''; lines.push(line); back = lines.length
  answer(`> ${line}`, 'asked')
  if (/^stop\b/.test(line)) { emergency(line.slice(4).trim() || 'from the console'); answer('vented'); return }
  const a = await act('say', { line })
  answer(a.ok ? say(a.said.text) : say(a.said))
}
function answer (text, kind = '') {
  if (!text) return
  const p = document.createElement('p'); p.className = kind; p.textContent = text
  $('#said').append(p)
  while ($('#said').children.length > 200) $('#said').firstChild.remove()
  p.scrollIntoView({ block: 'nearest' })
}
$('#line').onkeydown = async e => {
  const box = $('#line')
  if (e.key === 'Tab' && !e.shiftKey && box.value) {
    e.preventDefault()
    const a = await act('complete', { text: box.value })
    const found = a.ok ? a.said : []
    const head = box.value.slice(0, box.value.lastIndexOf(' ') + 1)
    if (found.length === 1) box.value = head + found[0] + (found[0].endsWith('=') ? '' : ' ')
    else if (found.length) answer(found.join('  '), 'asked')
  } else if (e.key === 'ArrowUp' || e.key === 'ArrowDown') {
    e.preventDefault()
    back = clamp(back + (e.key === 'ArrowUp' ? -1 : 1), 0, lines.length)
    box.value = lines[back] ?? ''
  }
}

// ---------------------------------------------------------------- keys, views, links
key('Enter', 'start', () => asks('start'))
key(' ', 'pause and resume', () => asks(status().paused ? 'resume' : 'pause'))
key('s', 'stop', () => asks('stop'))
for (const [name, by] of [['ArrowLeft', -1], ['ArrowRight', 1]]) {
  key(name, by < 0 ? 'cursor back by one sample; with Shift by ten' : 'cursor on by one sample; with Shift by ten', () => strips.step(by)); key(`Shift+${name}`, '', () => strips.step(10 * by))
}
key('Home', 'cursor to the begin of the window', () => strips.home(false)); key('End', 'cursor to its end', () => strips.home(true))
const window_ = k => { zoom = clamp(zoom * k, 0.05, 120); link({ window: zoom === 6 ? '' : +zoom.toPrecision(3) }); strips.dirty = true }
// A window that follows the newest sample grows and shrinks; one that is held is zoomed about the pointer.
strips.follows = k => { if (mode !== 'live' || strips.held) return false; window_(k); return true }
strips.reset = () => { zoom = 6; strips.cursor = null; strips.pinned = false; link({ window: '' }) }
const zooms = k => () => { if (strips.held) strips.zoomer.zoom(k); else window_(k) }
key('+', 'zoom in', zooms(0.5)); key('-', 'zoom out', zooms(2))
key('0', 'follow the newest sample', () => strips.zoomer.reset())
key('`', 'console', () => { view('log'); $('#line').focus() })
key('n', 'note at the cursor', () => { view('log'); $('#line').value = 'note '; $('#line').focus() })
key('v', 'speak the present values', () => { const e = $('#spoken'); e.textContent = ''; setTimeout(() => { e.textContent = spoken() }, 50) })
document.body.insertAdjacentHTML('beforeend', '<div id="spoken" class="vh" role="status" aria-live="assertive"></div>')
function view (name) { $('#face').dataset.view = name; for (const b of document.querySelectorAll('.ptabs button')) b.setAttribute('aria-pressed', String(b.dataset.view === name)); strips.dirty = true }
for (const b of document.querySelectorAll('.ptabs button')) b.onclick = () => view(b.dataset.view)
for (const name of ['status', 'lost', 'back', 'theme', 'projector']) events.addEventListener(name, () => { machine(); protocol(); strips.dirty = loop.dirty = true; if (name !== 'status') slow = 0; else { runBar(); buttons(); banner() } })
const own = new Measured(strips, () => { strips.width = 0; strips.ranges = {}; strips.dirty = true })
strips.own = loop.own = own
loop.changed = () => { strips.dirty = true }
$('#strips').figureDocument = () => strips.document()
$('.plotc').figureDocument = () => loop.document()
events.addEventListener('projector', () => { strips.width = 0; strips.dirty = loop.dirty = true })
events.addEventListener('escape', () => { strips.cursor = null; strips.pinned = false; strips.dirty = true })
addEventListener('resize', () => { strips.dirty = true })
events.addEventListener('status', () => { if (status().running) shownDry = dry })
window.lab.bench = { buffer, strips, loop, get mode () { return mode }, tell, idle, token }
requestAnimationFrame(frame)
