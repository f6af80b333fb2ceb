// Charts that stand still: a figure with data-chart becomes one. uPlot gives axes, grid and sizes; the lines are drawn here,
// since a loop is no function of x.
import uPlot from '../uplot/uPlot.esm.js'
import { events } from './lab.js'
import { View } from './view.js'
import { Q, TS, clamp, digits, ends, escape, fmt, mark, size, token, weight } from './words.js'
import './save.js'

const charts = new Map() // figure -> {plot, spec}
const zoomed = new Map() // name of a chart -> the part that is shown, so that a chart with newer values shows the same part

const colour = q => token(Q[q] ? `--q-${q}` : '--ink')
const precision = step => Math.max(0, Math.min(6, -Math.floor(Math.log10(step) + 1e-9)))
/** Axis settings common to all charts. */
export function axis (given = {}) {
  return {
    stroke: () => token('--ink-3'), font: `${size(11)}px ${token('--font')}`, gap: 4, ...given, size: size(given.size ?? 46),
    grid: { stroke: () => token('--grid'), width: 1, ...given.grid }, ticks: { show: false, ...given.ticks },
    values: given.values ?? ((u, ticks) => { const d = ticks.length > 1 ? digits(Math.abs(ticks[1] - ticks[0])) : 2; return ticks.map(v => fmt(v, d)) })
  }
}
function range (lines, of, given) {
  let low = Infinity; let high = -Infinity
  for (const l of lines) for (const v of l[of]) if (v !== null) { if (v < low) low = v; if (v > high) high = v }
  if (low > high) { low = 0; high = 1 }
  const room = (high - low) * 0.05 || Math.abs(high) * 0.05 || 1
  return ends(given.low ?? low - (of === 'y' ? room : 0), given.high ?? high + (of === 'y' ? room : 0))
}
const LOOP = 40 // points of a line that goes back and forth, from which on its direction is shown
const FAR = 1e5 // pixels from a canvas's corner beyond which nothing is drawn: a dashed line takes as long as it is long
/** Draw a line through points of a plot, in pixels of its canvas. */
export function stroke (ctx, xs, ys, { colour, width = 1.75, dash = [], fill = null, opacity = 1, close = false }, px = devicePixelRatio) {
  ctx.save()
  ctx.globalAlpha = opacity
  ctx.lineWidth = weight(width) * px; ctx.lineJoin = 'bevel'; ctx.setLineDash(dash.map(d => d * px)); ctx.strokeStyle = colour
  ctx.beginPath()
  let pen = false
  for (let i = 0; i < xs.length; i++) {
    if (Number.isNaN(xs[i]) || Number.isNaN(ys[i])) { pen = false; continue }
    const x = clamp(xs[i], -FAR, FAR); const y = clamp(ys[i], -FAR, FAR)
    if (pen) ctx.lineTo(x, y); else { ctx.moveTo(x, y); pen = true }
  }
  if (fill) { ctx.fillStyle = fill; ctx.fill() }
  if (close) ctx.closePath()
  ctx.stroke()
  ctx.restore()
}
export function dot (ctx, q, x, y, r, { hollow = false } = {}, px = devicePixelRatio) {
  const path = new Path2D(mark(q, x, y, weight(r) * px))
  ctx.save()
  ctx.lineWidth = 1.2 * px
  if (hollow) { ctx.strokeStyle = colour(q); ctx.fillStyle = token('--panel'); ctx.fill(path); ctx.stroke(path) } else {
    ctx.fillStyle = colour(q); ctx.strokeStyle = token('--panel'); ctx.fill(path); ctx.stroke(path)
  }
  ctx.restore()
}

/** The direction of a loop: heads at two places of its path, in pixels of the canvas. */
export function arrows (ctx, xs, ys, colour, px = devicePixelRatio) {
  const far = 6 * weight(1) * px
  ctx.save()
  ctx.fillStyle = colour
  for (const share of [0.22, 0.72]) {
    const i = Math.floor(share * xs.length); let j = i
    while (j < xs.length && !(Math.hypot(xs[j] - xs[i], ys[j] - ys[i]) > far)) j++
    if (j >= xs.length) continue
    const to = Math.atan2(ys[j] - ys[i], xs[j] - xs[i])
    ctx.beginPath()
    for (const [turn, reach] of [[0, 1.2], [2.5, 1], [-2.5, 1]]) ctx.lineTo(xs[i] + reach * far * Math.cos(to + turn), ys[i] + reach * far * Math.sin(to + turn))
    ctx.fill()
  }
  ctx.restore()
}
const rises = l => (l.rises ??= l.line && l.x.every((v, i) => v === null || i === 0 || l.x[i - 1] === null || v >= l.x[i - 1]))

function title (a) { return `<b style="color:${Q[a.quantity] ? `var(--q-${a.quantity})` : 'inherit'}">${escape(a.label)}</b>${a.unit ? `, ${escape(a.unit)}` : ''}` }

function draw (u, spec) {
  const { ctx, bbox } = u
  ctx.save()
  ctx.beginPath(); ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height); ctx.clip()
  for (const l of spec.shown ?? spec.lines) {
    const xs = l.x.map(v => v === null ? NaN : u.valToPos(v, 'x', true)); const ys = l.y.map(v => v === null ? NaN : u.valToPos(v, 'y', true))
    const dash = l.dash === 'own' ? Q[l.quantity]?.dash ?? [] : spec.dashes[l.dash] ?? []
    const fill = l.fill ? token(Q[l.quantity] ? `--q-${l.quantity}-fill` : '--tint') : null
    if (l.line) stroke(ctx, xs, ys, { colour: colour(l.quantity), width: l.width, dash, fill, opacity: l.opacity, close: l.fill })
    if (l.line && !l.fill && !rises(l) && l.x.length >= LOOP) arrows(ctx, xs, ys, colour(l.quantity))
    if (l.course && spec.at !== null) { const [i, , x, y] = [sample(l.course[0], spec.at), ...l.course]; if (i >= 0 && x[i] !== null && y[i] !== null) dot(ctx, l.quantity, u.valToPos(x[i], 'x', true), u.valToPos(y[i], 'y', true), 5) }
    if (l.points) { ctx.globalAlpha = l.opacity; xs.forEach((x, i) => dot(ctx, l.quantity, x, ys[i], 4, { hollow: true })); ctx.globalAlpha = 1 }
  }
  for (const m of spec.marks) {
    const c = token(m.stop ? '--stop' : '--ink-2')
    if (m.x !== null && m.y === null) { const x = u.valToPos(m.x, 'x', true); stroke(ctx, [x, x], [bbox.top, bbox.top + bbox.height], { colour: c, width: 1, dash: m.stop ? [] : [1, 3] }) }
    if (m.y !== null && m.x === null) { const y = u.valToPos(m.y, 'y', true); stroke(ctx, [bbox.left, bbox.left + bbox.width], [y, y], { colour: c, width: 1, dash: m.stop ? [] : [1, 3] }) }
  }
  ctx.restore()
  labels(u, spec)
}
const outside = (u, x, y) => (x !== null && (x < u.scales.x.min || x > u.scales.x.max)) || (y !== null && (y < u.scales.y.min || y > u.scales.y.max))
/** Words that lines and points leave readable. */
function above (ctx, words, x, y) {
  ctx.save()
  ctx.strokeStyle = token('--panel'); ctx.lineWidth = 3 * devicePixelRatio; ctx.lineJoin = 'round'
  ctx.strokeText(words, x, y)
  ctx.restore()
  ctx.fillText(words, x, y)
}
// Words at the ends of the lines, pushed apart where they would cover each other.
function labels (u, spec) {
  const { ctx, bbox } = u; const px = devicePixelRatio; const put = []
  for (const l of spec.shown ?? spec.lines) {
    if (!l.label) continue
    let i = l.x.length - 1
    while (i >= 0 && (l.x[i] === null || l.y[i] === null || outside(u, l.x[i], l.y[i]))) i--
    if (i >= 0) put.push({ text: l.label, x: u.valToPos(l.x[i], 'x', true) + 6 * px, y: u.valToPos(l.y[i], 'y', true), colour: colour(l.quantity) })
  }
  ctx.save()
  ctx.font = `${size(11) * px}px ${token('--font')}`; ctx.textBaseline = 'middle'; ctx.textAlign = 'left'
  put.sort((a, b) => a.y - b.y)
  const gap = size(12) * px
  const beside = i => Math.abs(put[i].x - put[i - 1].x) < 60 * px
  for (let i = 1; i < put.length; i++) if (put[i].y - put[i - 1].y < gap && beside(i)) put[i].y = put[i - 1].y + gap
  const floor = bbox.top + bbox.height - gap / 2 // above the numbers of the axis
  for (let i = put.length - 1, room = floor; i >= 0; i--) {
    put[i].y = Math.min(put[i].y, room)
    room = i > 0 && beside(i) ? put[i].y - gap : floor
  }
  for (const p of put) {
    ctx.fillStyle = p.colour
    const over = p.x + ctx.measureText(p.text).width - u.ctx.canvas.width
    above(ctx, p.text, over > 0 ? p.x - over - 2 * px : p.x, p.y)
  }
  for (const m of spec.marks) {
    if (!m.text || outside(u, m.x, m.y)) continue
    ctx.fillStyle = token(m.stop ? '--stop-ink' : '--ink-2')
    const x = m.x === null ? bbox.left + 6 * px : u.valToPos(m.x, 'x', true) + 4 * px
    const y = m.y === null ? bbox.top + 8 * px : u.valToPos(m.y, 'y', true) - 8 * px
    above(ctx, m.text, x, y)
  }
  ctx.restore()
}

function options (figure, spec, width) {
  const right = spec.lines.some(l => l.label) ? 8 + size(6.5) * Math.max(...spec.lines.map(l => l.label.length)) : 10
  return {
    width, height: size(spec.height), padding: [8, right, 0, 0], legend: { show: false }, cursor: { points: { show: false }, drag: { x: false, y: false } },
    scales: { x: { time: false, range: () => figure.zoomed?.x ?? figure.whole.x }, y: { range: () => figure.zoomed?.y ?? figure.whole.y } },
    series: [{}, { show: true, paths: () => null, points: { show: false } }],
    axes: [axis({ size: 24 }), axis({})],
    hooks: { draw: [u => draw(u, spec)], setCursor: [u => near(figure, u, spec)] }
  }
}
function near (figure, u, spec) {
  const tip = figure.querySelector('.tip')
  const { left, top } = u.cursor
  let best = null
  for (const l of left >= 0 ? spec.shown ?? spec.lines : []) {
    let of = null // its point that is nearest to the pointer: over a line that goes on to the right the one above or below it
    for (let i = 0; i < l.x.length; i++) {
      if (l.x[i] === null || l.y[i] === null) continue
      const dx = (u.valToPos(l.x[i], 'x') - left) ** 2; const dy = (u.valToPos(l.y[i], 'y') - top) ** 2; const key = rises(l) ? dx : dx + dy
      if (!of || key < of.key) of = { key, d: dx + dy, l, i }
    }
    if (of && of.key < 900 && (!best || of.d < best.d)) best = of
  }
  tip.hidden = !best
  if (!best) return
  const { l, i } = best
  tip.textContent = `${fmt(l.x[i], figure.px)}${TS}${spec.x.unit}, ${fmt(l.y[i], figure.py)}${TS}${spec.y.unit}${l.label ? ` \u00b7 ${l.label}` : ''}`
  const x = u.valToPos(l.x[i], 'x') + u.bbox.left / devicePixelRatio
  tip.style.left = `${clamp(x + 8, 0, figure.clientWidth - tip.offsetWidth)}px`
  tip.style.top = `${figure.querySelector('.plot').offsetTop + u.valToPos(l.y[i], 'y') + u.bbox.top / devicePixelRatio - 32}px`
}

function build (figure) {
  const spec = { at: null, shown: null, ...JSON.parse(figure.dataset.chart) }
  const was = charts.get(figure)
  was?.plot.destroy()
  figure.innerHTML = `<figcaption><span>${title(spec.y)}, against ${title(spec.x)}</span><span class="faint">${escape(spec.name)}</span></figcaption><div class="plot" tabindex="0" role="img" aria-label="${escape(spec.name)}. ${escape(spec.summary)}"></div><div class="tip" hidden></div><details class="values"><summary>Table of values</summary><div class="scroll"></div></details>`
  const [x0, x1] = range(spec.lines, 'x', spec.x); const [y0, y1] = range(spec.lines, 'y', spec.y)
  figure.px = precision((x1 - x0) / 1000); figure.py = precision((y1 - y0) / 1000)
  figure.whole = { x: [x0, x1], y: [y0, y1] }; figure.zoomed = null
  const place = figure.querySelector('.plot'); const key = `${spec.name} ${spec.y.label} ${spec.x.label}`
  const plot = new uPlot(options(figure, spec, Math.max(160, figure.clientWidth)), [[x0, x1], [y0, y1]], place)
  charts.set(figure, { plot, spec })
  const view = new View(place, {
    whole: () => figure.whole, box: () => plot.over.getBoundingClientRect(), inside: e => plot.over.contains(e.target) || e.target === plot.over,
    show: part => {
      figure.zoomed = part
      if (part) zoomed.set(key, part); else zoomed.delete(key)
      const { x, y } = part ?? figure.whole
      plot.batch(() => { plot.setScale('x', { min: x[0], max: x[1] }); plot.setScale('y', { min: y[0], max: y[1] }) })
      near(figure, plot, spec)
    }
  })
  const before = zoomed.get(key)
  if (before && before.x[0] < x1 && before.x[1] > x0 && before.y[0] < y1 && before.y[1] > y0) view.take(before)
  figure.querySelector('details').ontoggle = e => { if (e.target.open) fillTable(figure, spec) }
  place.onkeydown = e => walk(e, figure, plot, spec)
}
/** Number of the newest of rising times that is not after another; -1 where there is none. */
export function sample (times, at) {
  let low = 0; let high = times.length
  while (low < high) { const m = (low + high) >> 1; if (times[m] <= at) low = m + 1; else high = m }
  return at > times.at(-1) + 1e-9 ? -1 : low - 1
}
/** Show a time: in a chart over time a line with the value under it, in a loop its place. */
export function showTime (figure, t) {
  const { plot, spec } = charts.get(figure) ?? {}
  if (!plot) return
  if (spec.lines.some(l => l.course)) { spec.at = t; plot.redraw(false) } else plot.setCursor({ left: t === null ? -10 : plot.valToPos(t, 'x'), top: -10 })
}
/** Show what a loop did between two times; its usual part for null. */
export function showSpan (figure, span) {
  const { plot, spec } = charts.get(figure) ?? {}
  if (!spec?.lines.some(l => l.course)) return
  const part = ({ course: [t, x, y], ...l }) => { const inside = t.map(v => v >= span[0] && v <= span[1]); const cut = values => values.map((v, i) => inside[i] ? v : null); return { ...l, course: [t, x, y], x: cut(x), y: cut(y) } }
  spec.shown = span && spec.lines.map(l => l.course ? part(l) : l)
  figure.whole = { x: range(spec.shown ?? spec.lines, 'x', spec.x), y: range(spec.shown ?? spec.lines, 'y', spec.y) }
  if (!figure.zoomed) plot.batch(() => { for (const axis of ['x', 'y']) plot.setScale(axis, { min: figure.whole[axis][0], max: figure.whole[axis][1] }) })
  plot.redraw(false)
}
// With the arrows from point to point, so that a value costs no aiming.
function walk (e, figure, u, spec) {
  const step = { ArrowLeft: -1, ArrowRight: 1 }[e.key]
  const other = { ArrowUp: -1, ArrowDown: 1 }[e.key]
  if ((!step && !other) || e.ctrlKey || e.altKey) return
  e.preventDefault(); e.stopPropagation()
  const at = figure.at ??= { line: 0, i: -1 }
  if (other) at.line = clamp(at.line + other, 0, spec.lines.length - 1)
  const l = spec.lines[at.line]
  at.i = clamp(at.i + (step ?? 0) * (e.shiftKey ? 10 : 1), 0, l.x.length - 1)
  u.setCursor({ left: u.valToPos(l.x[at.i], 'x'), top: u.valToPos(l.y[at.i], 'y') })
}
function fillTable (figure, spec) {
  const rows = []
  for (const l of spec.lines) {
    const step = Math.max(1, Math.ceil(l.x.length / 200))
    for (let i = 0; i < l.x.length; i += step) if (l.x[i] !== null) rows.push(`<tr><td>${escape(l.label || l.quantity)}</td><td class="num">${fmt(l.x[i], figure.px)}</td><td class="num">${l.y[i] === null ? '\u2013' : fmt(l.y[i], figure.py)}</td></tr>`)
  }
  figure.querySelector('.scroll').innerHTML = `<table><thead><tr><th>Line</th><th class="num">${escape(spec.x.label)}, ${escape(spec.x.unit)}</th><th class="num">${escape(spec.y.label)}, ${escape(spec.y.unit)}</th></tr></thead><tbody>${rows.join('')}</tbody></table>`
}

const sizes = new ResizeObserver(list => {
  for (const { target } of list) { const one = charts.get(target); if (one && target.clientWidth > 0 && Math.abs(one.plot.width - target.clientWidth) > 1) one.plot.setSize({ width: Math.max(160, target.clientWidth), height: size(one.spec.height) }) }
})
function look () {
  for (const figure of document.querySelectorAll('figure.chart[data-chart]')) {
    if (figure.drawn === figure.dataset.chart) continue
    figure.drawn = figure.dataset.chart
    build(figure)
    sizes.observe(figure)
  }
  for (const [figure, { plot }] of charts) if (!figure.isConnected) { plot.destroy(); sizes.unobserve(figure); charts.delete(figure) }
}
let due = false
new MutationObserver(() => { if (!due) { due = true; requestAnimationFrame(() => { due = false; look() }) } })
  .observe(document.documentElement, { childList: true, subtree: true, attributes: true, attributeFilter: ['data-chart'] })
events.addEventListener('theme', () => { for (const { plot } of charts.values()) plot.redraw(false, true) })
events.addEventListener('projector', () => { for (const figure of [...charts.keys()]) build(figure) })
look()
