// The page Energy: both loops of a cycle, its numbers, its efficiency over pressure, and the flow of energy of a recording.
import { say, TS, escape, fmt, projected, size } from './words.js'
import { Plot, draws } from './plot.js'
import { sankey } from './sankey.js'

const P = 'var(--q-pressure)'; const F = 'var(--q-tension)'
const title = (q, words, unit) => `<tspan style="${q ? `fill:var(--q-${q});` : ''}font-weight:600">${words}</tspan>, ${unit}`
const top = v => v + 0.1 * v
const joules = v => `${fmt(v, 2)}${TS}J`

function corners (p, all, beside) {
  for (const [name, [x, y]] of Object.entries(all)) {
    const [dx, dy] = beside[name] ?? beside[name[0]] ?? [10, -8]
    p.dot(x, y).text(x, y, name, { dx, dy, k: 'val', a: 'middle' })
  }
}
function piston (place, d, w) {
  const l = d.piston; const X = Math.max(...l.x, ...(l.other?.x ?? [])); const Y = Math.max(...l.y)
  const p = new Plot(w, 312, [0, 1.06 * X], [0, top(Y) + 0.2], {}, place)
  p.grid()
  // the part that a shortening muscle takes, twice as dark as what compresses
  const low = Math.min(...l.y)
  p.line(l.x, l.y, { c: 'none', fill: 'var(--q-pressure-fill)', close: true })
  if (d.cycle === 'maximal') p.line([l.at, l.rest, l.rest, l.at], [Y, Y, low, low], { c: 'none', fill: 'var(--q-pressure-fill)', close: true }).line([l.at, l.at], [Y, low], { c: 'var(--ink-3)', w: 1, d: '2 3' })
  const other = d.exchange === 'atmosphere' ? 'accumulator' : 'atmosphere'
  if (l.other) p.line(l.other.x, l.other.y, { c: P, w: 1.25, d: '5 3', name: other })
  p.line(l.x, l.y, { c: P, w: 2.25, close: true, name: d.exchange })
  if (l.other && d.exchange === 'atmosphere') { const at = Math.min(...l.other.y); p.text(l.other.x[0], at, 'accumulator', { dx: 10, dy: -8 }) }
  corners(p, l.corners, { A: [0, -10], B: [10, -8], C: [-9, -8], D: [-10, 14], E: [0, -10], F: [11, -6], G: [-9, -8], H: [-10, 14] })
  const names = Object.keys(l.corners); const first = l.corners[names[0]]
  if (d.cycle === 'maximal') {
    const wide = p.X(l.at) - p.X(l.rest)
    if (wide > 44) p.text((l.at + l.rest) / 2, (Y + low) / 2, joules(l.w12), { k: 'val', a: 'middle' })
    const x = l.at + 0.07 * (first[0] - l.at)
    const y = l.other && d.exchange === 'atmosphere' ? Math.min(...l.other.y) + 0.12 * (Y - low) : low + 0.22 * (Y - low)
    p.text(x, y, joules(l.w01), { k: 'val', dx: 4, dy: 14 - size(14) })
    const room = Math.max(...l.x.filter((_, i) => p.Y(l.y[i]) < p.Y(y) + 2).map(v => p.X(v))) - p.X(x) // to the line, above the words
    if (d.exchange === 'atmosphere') p.text(x, y, room < 124 ? 'lost' : 'lost when exhaling', { dx: 4, dy: 14 })
  } else {
    p.text(0.5 * X, low + 0.72 * (Y - low), `${joules(l.input)} in`, { k: 'val' })
    if (l.throttled) p.text(0.5 * X, low + 0.72 * (Y - low), `${joules(l.throttled)} of it throttled`, { dy: size(14) })
  }
  p.frame(title('pressure', 'Pressure', 'bar absolute'), `<tspan style="font-weight:600">volume</tspan>, cm\u00b3`)
  p.into(place, 'Pressure against volume', `The cycle ${names.join(' ')} of ${d.title} at ${fmt(d.pressure, 2)} bar; its area is the input, ${fmt(l.input, 2)} J.`, [{ name: 'volume', unit: 'cm\u00b3', places: 1 }, { name: 'pressure', unit: 'bar', places: 2 }])
}
function tendon (place, d, w) {
  const l = d.tendon; const xs = [...l.x, ...(l.other?.x ?? [])]; const a = Math.min(...xs); const b = Math.max(...xs); const room = 0.08 * (b - a)
  const Y = Math.max(...l.y, ...(l.other?.y ?? [])); const low = Math.min(0, ...l.y)
  const p = new Plot(w, 312, [a - room, b + 1.4 * room], [low && 1.1 * low, top(Y)], {}, place)
  p.grid()
  if (l.other) p.line(l.other.x, l.other.y, { c: F, w: 1, d: '4 3', name: 'without friction' })
  p.line(l.x, l.y, { c: F, w: 2.5, fill: 'var(--q-tension-fill)', close: true, name: d.friction ? 'with friction' : 'without friction' })
  const maximal = d.cycle === 'maximal'
  corners(p, l.corners, maximal ? { A: [13, 4], B: [13, 0], C: [-4, -10], D: [0, -10] } : { E: [13, 4], F: [13, 0], G: [-10, -8], H: [11, -8] })
  if (l.other) {
    const m = maximal ? Math.floor(l.other.x.length * (w < 420 ? 0.2 : 0.34)) : 20 // a narrow chart has the label further to the right
    p.text(l.other.x[m], l.other.y[m], 'without friction', maximal ? { a: 'end', dx: -8, dy: -8 } : { a: 'middle', dy: -8 })
  }
  const mid = maximal ? a + 0.68 * (b - a) : (a + b) / 2
  const at = maximal ? 0.33 * Y : 0.55 * Y
  p.text(mid, at, joules(l.output), { a: 'middle', k: 'val', f: 'font-size:20px;fill:var(--q-tension)' }).text(mid, at, 'out, as work', { a: 'middle', dy: size(16) })
  p.frame(title('tension', 'Tension', 'N'), title('length', 'length', 'cm'))
  p.into(place, 'Tension against length', `The cycle ${Object.keys(l.corners).join(' ')}; its area is the output, ${fmt(l.output, 2)} J.`, [{ name: 'length', unit: 'cm', places: 2 }, { name: 'tension', unit: 'N', places: 1 }])
}
const DASH = { atmosphere: '', accumulator: '8 3' }
function curve (place, d, w) {
  const h = w > 300 ? 320 : 264; const most = Math.max(0.1, ...d.lines.filter(l => l.friction).flatMap(l => l.y), d.efficiency ?? 0, d.other_efficiency ?? 0)
  const p = new Plot(w, h, [0, d.highest], [0, Math.min(1, 1.12 * most)], { t: 22, r: 12, b: 36, l: 40 }, place)
  p.grid(5, 4)
  const words = l => l.words + (l.friction ? '' : ', no friction')
  for (const l of d.lines) {
    const high = p.whole.y[1]; const x = l.x.filter((_, i) => l.y[i] <= high); const y = l.y.filter(v => v <= high)
    if (x.length) p.line(x, y, { w: l.friction ? 2 : 1, d: l.friction ? DASH[l.words] : '2 3', c: l.friction ? 'var(--ink)' : 'var(--ink-2)', name: words(l) })
    if (l.friction && x.length) p.text(x.at(-1), y.at(-1), l.words, { a: 'end', dx: -2, dy: projected() && l.words === 'accumulator' ? 13 : size(16) })
  }
  if (d.pressure <= d.highest) {
    p.add(`<path d="M${p.X(d.pressure).toFixed(1)} ${p.m.t}V${h - p.m.b}" stroke="${P}" stroke-width="1.5"${p.cut}/>`)
    const right = d.pressure < 0.75 * d.highest
    for (const v of [d.efficiency, d.other_efficiency]) if (v !== null && v >= 0 && p.shows(d.pressure, v)) p.add(`<circle cx="${p.X(d.pressure)}" cy="${p.Y(v)}" r="4" fill="var(--ink)" stroke="var(--panel)" stroke-width="1.5"/>`).text(d.pressure, v, fmt(v, 3), { dx: right ? 7 : -7, dy: -7, k: 'val', a: right ? 'start' : 'end' })
  }
  if (d.lines.some(l => !l.friction)) p.text(p.x[1], p.y[0], 'dotted: without friction', { a: 'end', dx: -6, dy: -7, k: 'tick' })
  p.frame('<tspan style="font-weight:600">Efficiency</tspan>', title('pressure', 'supply pressure', 'bar'))
  p.into(place, 'Efficiency over supply pressure', `At ${fmt(d.pressure, 2)} bar ${d.exchange} ${fmt(d.efficiency, 3)}.`, [{ name: 'pressure', unit: 'bar', places: 2 }, { name: 'efficiency', unit: '', places: 4 }])
}
const paper = v => v === '' ? '' : typeof v === 'object' ? `<s>${fmt(v.struck, 2)}</s> ${fmt(v.instead, 3)}` : fmt(v, 2)
function numbers (place, d) {
  const strong = /^(In|Out|Efficiency)$/
  const rows = d.rows.map(r => `<div data-row="${escape(r.words)}" data-value="${r.value}"><dt>${strong.test(r.words) ? `<b>${r.words}</b>` : r.words}</dt><dd class="${r.quantity}">${fmt(r.value ?? NaN, r.places)}<span class="u">${r.unit ? TS + r.unit : ''}</span></dd><dd class="pp">${paper(r.paper)}</dd></div>`).join('')
  const printed = d.rows.some(r => r.paper !== '')
  place.innerHTML = `<dl class="kpi">${printed ? '<div class="head"><dt></dt><dd></dd><dd class="pp">paper, 5' + TS + 'bar</dd></div>' : ''}${rows}</dl><p class="say">${d.say.map(s => escape(say(s))).join(' ')}</p>`
}
const HEADS = { input: 'In', output: 'Out', friction: 'Friction', throttling: 'Throttled in the valve', exhaust: 'Lost in the exhaust', emptying: 'Work on that air', slackening: 'Slack braid', unaccounted: 'Unaccounted' }
const VOLUMES = { paper: 'eq. 38b', potential: 'of the law' }
function losses (place, d) {
  place.innerHTML = `<table><thead><tr><th>J</th>${d.volumes.map(v => `<th class="num">${VOLUMES[v.volume]}</th>`).join('')}</tr></thead><tbody>${Object.entries(HEADS).map(([k, words]) => `<tr><td>${words}</td>${d.volumes.map(v => `<td class="num" data-part="${v.volume}.${k}" data-value="${v[k]}">${fmt(v[k] ?? NaN, 3)}</td>`).join('')}</tr>`).join('')}<tr><td>Efficiency</td>${d.volumes.map(v => `<td class="num" data-part="${v.volume}.efficiency" data-value="${v.efficiency}">${fmt(v.efficiency ?? NaN, 4)}</td>`).join('')}</tr></tbody></table><p class="say">${d.more.map(s => escape(say(s))).join(' ')}</p>`
}
draws('.e-piston', piston)
draws('.e-tendon', tendon)
draws('.e-curve', curve)
draws('.e-numbers', numbers)
draws('.e-losses', losses)
draws('.e-flow', sankey)

// The slider: what is dragged shows at once, the server's numbers follow.
document.addEventListener('input', e => {
  const range = e.target.closest?.('.supply input[type=range]')
  if (!range) return
  follow(range)
  const field = document.querySelector('.supply .field input')
  if (field) field.value = fmt(+range.value, 1)
})
function follow (range) { range.parentElement.style.setProperty('--f', `${(range.value - range.min) / (range.max - range.min) * 100}%`) }
document.addEventListener('keydown', e => {
  const range = e.target.closest?.('.supply input[type=range]')
  if (!range || !e.shiftKey || !e.key.startsWith('Arrow')) return
  e.preventDefault()
  range.value = +range.value + (['ArrowRight', 'ArrowUp'].includes(e.key) ? 10 : -10) * range.step
  range.dispatchEvent(new Event('input', { bubbles: true }))
})
draws('.supply .tr', place => requestAnimationFrame(() => { const range = place.querySelector('input'); if (range) { range.value = JSON.parse(place.dataset.spec); follow(range) } }))
