// The pictures of the page Fit: a figure with data-fit becomes one. Every number comes from the server; this script only draws.
import { calls } from './elements.js'
import { events } from './lab.js'
import { Plot, nice, zooms } from './plot.js'
import { fromDrawing, inDrawing, magnify } from './view.js'
import { TS, clamp, escape, fmt, mark, size, weight } from './words.js'

const F = 'var(--q-tension)'
const number = (v, d = 1) => fmt(v, d)
const name = (q, word) => `<tspan style="fill:var(--q-${q});font-weight:600">${word}</tspan>`
const path = pts => pts.length ? 'M' + pts.map(p => `${p[0].toFixed(1)} ${p[1].toFixed(1)}`).join('L') : ''

class Picture extends Plot {
  constructor (w, h, x, y, m, figure) { super(w, h, x, y, { t: 26, r: 14, b: 26, l: 46, ...m }, figure) }
  grid (words = null) {
    const { l, r, t, b } = this.m
    const xs = nice(...this.x, Math.max(2, (this.w - l - r) / size(70))); const ys = nice(...this.y, Math.max(2, (this.h - t - b) / 44))
    for (const v of xs.ticks) this.s += `<path d="M${this.X(v).toFixed(1)} ${t}V${this.h - b}" stroke="var(--grid)"/><text class="tick" x="${this.X(v).toFixed(1)}" y="${this.h - b + size(14)}" text-anchor="middle">${fmt(v, xs.places)}</text>`
    for (const v of ys.ticks) this.s += `<path d="M${l} ${this.Y(v).toFixed(1)}H${this.w - r}" stroke="var(--grid)"/><text class="tick" x="${l - 6}" y="${(this.Y(v) + 4).toFixed(1)}" text-anchor="end">${words ? words(v) : fmt(v, ys.places)}</text>`
    return this.add(`<rect x="${l}" y="${t}" width="${this.wide}" height="${this.high}" fill="none" stroke="var(--rule)"/>`)
  }

  line (pts, width = 1.75, opacity = 1) { return this.add(`<path d="${path(pts.map(p => [this.X(p[0]), this.Y(p[1])]))}" fill="none" stroke="${F}" stroke-width="${weight(width)}" stroke-linejoin="round" opacity="${opacity}"${this.cut}/>`) }
  title (markup) { return this.add(`<text x="${this.m.l}" y="15" style="font-size:${size(12)}px;fill:var(--ink-2)">${markup}</text>`) }
  svg () { return `<svg width="${this.w}" height="${this.h}" viewBox="0 0 ${this.w} ${this.h}" aria-hidden="true">${this.s}</svg>` }
  /** Places of points in the picture, with what is said of each; those outside of it are left out. */
  spots (points, x, y, words) { return points.filter(q => this.shows(x(q), y(q))).map(q => [this.X(x(q)), this.Y(y(q)), words(q), q]) }
}
const triangle = (x, y) => `<path d="${mark('tension', x, y, 3.6)}" fill="var(--panel)" stroke="${F}" stroke-width="1.3"/>`
const told = (d, p) => `<b class="F">${number(p.F)}${TS}N</b> measured, ${number(p.e)} off<br>${fmt(p.L, 2)}${TS}cm, ${fmt(p.P, 2)}${TS}bar`

function tension (d, w, h, figure) {
  const narrow = w < size(480)
  const top = d.top * 1.06; const p = new Picture(w, h, d.x, [0, top], { l: 52, r: size(62), b: size(narrow ? 52 : 38) }, figure).grid()
  const strong = new Set(d.labelled)
  d.curves.forEach((c, i) => p.line(c.x.map((x, j) => [x, c.y[j]]).filter(q => q[1] <= top), strong.has(i) ? 1.75 : 1, strong.has(i) ? 1 : 0.45))
  let last = Infinity
  const ends = d.curves.map((c, i) => ({ i, P: c.P, at: c.x.map((x, j) => [x, c.y[j]]).filter(q => q[1] <= top && p.shows(...q)).at(-1) })).filter(e => e.at).sort((a, b) => b.P - a.P)
  let first = true
  for (const e of ends) {
    const y = p.Y(e.at[1])
    if (Math.abs(y - last) < size(12) && last !== Infinity) continue
    last = y
    p.add(`<text class="tick" x="${p.X(e.at[0]) + 6}" y="${y + 4}" style="fill:var(--q-pressure);${strong.has(e.i) ? 'font-weight:600' : ''}">${fmt(e.P, 2)}${first ? `${TS}bar` : ''}</text>`)
    first = false
  }
  if (d.rest !== null && p.shows(d.rest, 0)) p.add(`<path d="M${p.X(d.rest)} ${p.Y(0)}v5" stroke="var(--ink)"/><text class="tick" x="${p.X(d.rest)}" y="${p.Y(0) + size(28)}" text-anchor="middle">rest length</text>`)
  for (const L of d.slack) if (p.shows(L, 0)) p.add(`<circle cx="${p.X(L)}" cy="${p.Y(0)}" r="3.2" fill="var(--panel)" stroke="var(--ink-3)"/>`)
  const spots = p.spots(d.points, q => q.L, q => q.F, q => told(d, q))
  for (const s of spots) p.add(triangle(s[0], s[1]))
  if (d.source) p.add(`<text class="tick" x="${narrow ? 2 : 52}" y="${h - 2}">${escape(d.source)}</text>`)
  p.title(`${name('tension', 'Tension')}, N, against ${name('length', 'length')}, cm${narrow ? '' : `; beside the lines the ${name('pressure', 'pressure')}, bar`}`)
  return [p.svg(), spots, p]
}
function errors (d, w, h, figure) {
  const most = Math.max(...d.points.map(q => Math.abs(q.e)), d.percent) * 1.12
  const p = new Picture(w, h, d.x, [-most, most], { l: 52, b: 38 }, figure)
  p.add(`<rect x="52" y="${p.Y(d.percent)}" width="${Math.max(0, w - 66)}" height="${Math.max(0, p.Y(-d.percent) - p.Y(d.percent))}" fill="var(--tint)"${p.cut}/>`).grid(v => (v > 0 ? '+' : '') + fmt(v, most < 5 ? 1 : 0))
  p.add(`<path d="M52 ${p.Y(0)}H${w - 14}" stroke="var(--edge)"${p.cut}/>`)
  if (p.shows(p.x[0], d.percent)) p.add(`<text class="tick" x="${w - 18}" y="${p.Y(d.percent) - 4}" text-anchor="end">1${TS}% of the largest tension</text>`)
  const spots = p.spots(d.points, q => q.L, q => q.e, q => told(d, q))
  for (const s of spots) p.add(triangle(s[0], s[1]))
  p.title(`${name('tension', 'Tension')} measured less fitted, N, against ${name('length', 'length')}, cm`)
  return [p.svg(), spots, p]
}
function bubbles (d, w, h, figure) {
  const most = Math.max(...d.points.map(q => Math.abs(q.e)), 1e-9); const radius = e => Math.sqrt(Math.abs(e) / most) * 9
  const p = new Picture(w, h, d.x, [0, d.highest * 1.08], { l: size(34), r: size(78), b: size(24), t: 24 }, figure).grid()
  const spots = p.spots(d.points, q => q.L, q => q.P, q => told(d, q))
  const ring = (x, y, e) => `<circle cx="${x}" cy="${y}" r="${Math.max(1, radius(e)).toFixed(1)}" fill="${e > 0 ? F : 'var(--panel)'}" fill-opacity="${e > 0 ? 0.8 : 1}" stroke="${F}" stroke-width="1.3"/>`
  for (const [x, y, , q] of spots) p.add(ring(x, y, q.e))
  ;[most, most / 4, -most / 4, -most].forEach((e, i) => p.add(`${ring(w - size(56), 44 + i * 30, e)}<text class="tick" x="${w - size(42)}" y="${48 + i * 30}">${e > 0 ? '+' : ''}${number(e, clamp(-Math.floor(Math.log10(most / 4)), 0, 6))}${i ? '' : `${TS}N`}</text>`))
  p.add(`<text class="tick" x="4" y="14">${name('pressure', 'Pressure')}, bar, against ${name('length', 'length')}, cm</text>`)
  return [p.svg(), spots, p]
}
function left (d, w, h, figure) {
  const most = Math.max(...d.left.map(q => Math.abs(q.e) / d.percent), 1) * 1.2
  const p = new Picture(w, h, [0, d.highest * 1.05], [-most, most], { l: size(44), b: size(34), t: 10 }, figure).grid(v => `${v > 0 ? '+' : ''}${fmt(v, v % 1 ? 1 : 0)}${TS}%`)
  const spots = p.spots(d.left, q => q.P, q => q.e / d.percent, q => `${fmt(q.P, 2)}${TS}bar left out<br><b class="F">${number(q.e)}${TS}N</b> off at ${fmt(q.L, 2)}${TS}cm`)
  for (const s of spots) p.add(`<path d="M${s[0]} ${p.Y(0)}V${s[1]}" stroke="${F}" stroke-width="3"${p.cut}/>`)
  p.add(`<path d="M${p.m.l} ${p.Y(0)}H${w - 14}" stroke="var(--edge)"${p.cut}/><text class="tick" x="${w - 14}" y="${h - 4}" text-anchor="end">${w < size(340) ? 'largest error' : 'largest error, of the largest tension,'} against ${name('pressure', 'pressure')}, bar</text>`)
  return [p.svg(), spots, p]
}
// Length to the right, pressure into the depth, tension up; turned by dragging or with the arrows.
function surface (d, w, h, figure) {
  const turn = figure.turn ??= { a: -0.55, b: 0.5 }
  const { lengths, pressures, tension: z } = d.surface; const sa = Math.sin(turn.a); const ca = Math.cos(turn.a); const sb = Math.sin(turn.b); const cb = Math.cos(turn.b)
  const unit = (v, a, b) => (v - a) / (b - a || 1) - 0.5
  const span = Math.min(w * 0.62, h * 0.72)
  const at = (L, P, T) => {
    const x = unit(L, lengths[0], lengths.at(-1)); const y = unit(P, 0, d.highest); const u = clamp(T, 0, d.top) / d.top - 0.5
    const depth = -x * sa + y * ca
    return [w / 2 + (x * ca + y * sa) * span, h / 2 + 6 - (u * cb * 0.82 + depth * sb * 0.8) * span, depth]
  }
  let s = ''
  const floor = [[lengths[0], 0], [lengths.at(-1), 0], [lengths.at(-1), d.highest], [lengths[0], d.highest]].map(q => at(q[0], q[1], 0))
  s += `<path d="${path(floor)}z" fill="var(--sunken)" stroke="var(--rule)"/>`
  const faces = []
  for (let i = 0; i + 1 < pressures.length; i++) {
    for (let j = 0; j + 1 < lengths.length; j++) {
      const four = [[i, j], [i, j + 1], [i + 1, j + 1], [i + 1, j]].map(([m, n]) => at(lengths[n], pressures[m], z[m][n]))
      const mean = (z[i][j] + z[i][j + 1] + z[i + 1][j] + z[i + 1][j + 1]) / 4 / d.top
      if (mean > 0) faces.push([four.reduce((a, q) => a + q[2], 0), four, mean])
    }
  }
  faces.sort((a, b) => b[0] - a[0])
  for (const [, four, mean] of faces) s += `<path d="${path(four)}z" fill="var(--panel)"/><path d="${path(four)}z" fill="${F}" fill-opacity="${(0.08 + 0.5 * clamp(mean, 0, 1)).toFixed(2)}" stroke="${F}" stroke-opacity=".55" stroke-width=".7"/>`
  const spots = d.points.map(q => { const [x, y] = at(q.L, q.P, q.F); return [x, y, told(d, q)] })
  for (const q of spots) s += triangle(q[0], q[1])
  const front = (a, b) => a[0][2] + a[1][2] < b[0][2] + b[1][2] ? a : b
  const edge = (a, b, words, q) => { const x = (a[0] + b[0]) / 2; const y = (a[1] + b[1]) / 2; s += `<text class="tick" x="${x}" y="${y + 20}" text-anchor="middle">${name(q, words)}</text>` }
  edge(...front([floor[0], floor[1]], [floor[3], floor[2]]), `Length ${fmt(lengths[0], 1)} to ${fmt(lengths.at(-1), 1)}${TS}cm`, 'length')
  edge(...front([floor[1], floor[2]], [floor[0], floor[3]]), `Pressure 0 to ${fmt(d.highest, 2)}${TS}bar`, 'pressure')
  s += `<text x="12" y="15" style="font-size:12px;fill:var(--ink-2)">${name('tension', 'Tension')}, N, 0 to ${number(d.top, 0)}, over length and pressure; drag to turn</text>`
  return [`<svg width="${w}" height="${h}" viewBox="0 0 ${w} ${h}" aria-hidden="true" style="cursor:grab;touch-action:pan-y">${s}</svg>`, spots]
}
const KINDS = { tension, errors, bubbles, left, surface }

function build (figure) {
  const d = JSON.parse(figure.dataset.fit); const w = figure.clientWidth
  if (w < 40) return
  const [svg, spots, plot] = KINDS[figure.dataset.kind](d, w, size(+figure.dataset.height), figure)
  figure.style.height = `${size(+figure.dataset.height)}px`
  figure.innerHTML = svg + '<div class="tip" hidden></div>'
  figure.spots = spots
  figure.redraw = () => build(figure)
  if (plot) zooms(figure, figure, plot)
  else {
    figure.zoomer ??= magnify(figure, { drags: () => true })
    figure.zoomer.chart.show(figure.zoomer.range)
  }
}
function show (figure, i) {
  const tip = figure.querySelector('.tip'); const s = figure.spots?.[i]
  figure.querySelector('.ring')?.remove()
  figure.at = i
  if (!tip) return
  tip.hidden = !s
  if (!s) return
  tip.innerHTML = s[2]
  const [x, y] = fromDrawing(figure.querySelector('svg'), s)
  tip.style.left = `${clamp(x + 12, 0, figure.clientWidth - tip.offsetWidth)}px`
  tip.style.top = `${Math.max(0, y - tip.offsetHeight - 8)}px`
  figure.querySelector('svg').insertAdjacentHTML('beforeend', `<circle class="ring" cx="${s[0]}" cy="${s[1]}" r="8" fill="none" stroke="var(--ink)" stroke-width="1.5"/>`)
}
function near (figure, e) {
  const svg = figure.querySelector('svg')
  if (!svg) return
  const [x, y] = inDrawing(svg, e)
  let best = null
  ;(figure.spots ?? []).forEach((s, i) => { const r = (s[0] - x) ** 2 + (s[1] - y) ** 2; if (r < 625 && (!best || r < best[0])) best = [r, i] })
  show(figure, best ? best[1] : -1)
}
function ready (figure) {
  figure.addEventListener('pointermove', e => {
    if (figure.from) {
      figure.turn = { a: figure.from.a + (e.clientX - figure.from.x) / 140, b: clamp(figure.from.b + (e.clientY - figure.from.y) / 200, 0.1, 1.3) }
      build(figure)
    } else if (!figure.zoomer?.dragged) near(figure, e)
  })
  figure.addEventListener('pointerdown', e => { if (figure.dataset.kind === 'surface' && !e.shiftKey && figure.zoomer?.pointers.size < 2) { figure.from = { x: e.clientX, y: e.clientY, ...figure.turn }; figure.setPointerCapture(e.pointerId) } else figure.from = null })
  for (const name of ['pointerup', 'pointercancel']) figure.addEventListener(name, () => { figure.from = null })
  figure.addEventListener('pointerleave', () => show(figure, -1))
  figure.addEventListener('keydown', e => {
    const step = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: -1, ArrowDown: 1 }[e.key]
    if (!step || e.ctrlKey || e.altKey) return
    e.preventDefault(); e.stopPropagation()
    if (figure.dataset.kind === 'surface' && e.shiftKey) {
      const across = e.key === 'ArrowLeft' || e.key === 'ArrowRight'
      figure.turn = { a: figure.turn.a + (across ? step * 0.1 : 0), b: clamp(figure.turn.b + (across ? 0 : step * 0.1), 0.1, 1.3) }
      build(figure)
    } else show(figure, clamp((figure.at ?? -1) + step, 0, figure.spots.length - 1))
  })
}
events.addEventListener('projector', () => { for (const figure of document.querySelectorAll('figure[data-fit]')) build(figure) })
const sizes = new ResizeObserver(list => { for (const { target } of list) if (target.isConnected && target.wide !== target.clientWidth) { target.wide = target.clientWidth; build(target) } })
function look () {
  for (const figure of document.querySelectorAll('figure[data-fit]')) {
    const key = figure.dataset.kind + figure.dataset.fit
    if (figure.drawn === key) continue
    if (!figure.drawn) { ready(figure); sizes.observe(figure) }
    figure.drawn = key
    build(figure)
  }
}
let due = false
new MutationObserver(() => { if (!due) { due = true; requestAnimationFrame(() => { due = false; look() }) } })
  .observe(document.documentElement, { childList: true, subtree: true, attributes: true, attributeFilter: ['data-fit', 'data-kind'] })
look()

// A report opens in a page of its own, which must be asked for by the click itself.
let opened = null
const ask = () => { opened = window.open('', '_blank'); if (opened) opened.document.title = 'Making the report ..' }
addEventListener('click', e => { if (e.target.closest?.('[data-opens=report]')) ask() }, true)
calls.set('showReport', (html, file) => {
  const url = URL.createObjectURL(new Blob([html], { type: 'text/html' }))
  if (opened && !opened.closed) opened.location = url
  else { const a = document.createElement('a'); a.href = url; a.download = file; a.click() }
  opened = null
})
calls.set('dropReport', () => { opened?.close(); opened = null })
