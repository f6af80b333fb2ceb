// The pictures of the page Fit: a figure with data-fit becomes one. Every number comes from the server; this script only draws.
import { calls } from './elements.js'
import { nice } from './plot.js'
import { TS, clamp, escape, fmt, mark } from './words.js'

const F = 'var(--q-tension)'
const number = (v, d = 1) => fmt(v, d)
const name = (q, word) => `<tspan style="fill:var(--q-${q});font-weight:600">${word}</tspan>`
const path = pts => pts.length ? 'M' + pts.map(p => `${p[0].toFixed(1)} ${p[1].toFixed(1)}`).join('L') : ''

class Plot {
  constructor (w, h, x, y, m) {
    Object.assign(this, { w, h, x, y, s: '', m: { t: 26, r: 14, b: 26, l: 46, ...m } })
  }

  X (v) { return this.m.l + (v - this.x[0]) / (this.x[1] - this.x[0]) * (this.w - this.m.l - this.m.r) }
  Y (v) { return this.h - this.m.b - (v - this.y[0]) / (this.y[1] - this.y[0]) * (this.h - this.m.t - this.m.b) }
  add (s) { this.s += s; return this }
  grid (words = null) {
    const { l, r, t, b } = this.m
    const xs = nice(...this.x, Math.max(2, (this.w - l - r) / 70)); const ys = nice(...this.y, Math.max(2, (this.h - t - b) / 44))
    for (const v of xs.ticks) this.s += `<path d="M${this.X(v).toFixed(1)} ${t}V${this.h - b}" stroke="var(--grid)"/><text class="tick" x="${this.X(v).toFixed(1)}" y="${this.h - b + 14}" text-anchor="middle">${fmt(v, xs.places)}</text>`
    for (const v of ys.ticks) this.s += `<path d="M${l} ${this.Y(v).toFixed(1)}H${this.w - r}" stroke="var(--grid)"/><text class="tick" x="${l - 6}" y="${(this.Y(v) + 4).toFixed(1)}" text-anchor="end">${words ? words(v) : fmt(v, ys.places)}</text>`
    return this.add(`<rect x="${l}" y="${t}" width="${Math.max(0, this.w - l - r)}" height="${Math.max(0, this.h - t - b)}" fill="none" stroke="var(--rule)"/>`)
  }

  line (pts, width = 1.75, opacity = 1) { return this.add(`<path d="${path(pts.map(p => [this.X(p[0]), this.Y(p[1])]))}" fill="none" stroke="${F}" stroke-width="${width}" stroke-linejoin="round" opacity="${opacity}"/>`) }
  title (markup) { return this.add(`<text x="${this.m.l}" y="15" style="font-size:12px;fill:var(--ink-2)">${markup}</text>`) }
  svg () { return `<svg width="${this.w}" height="${this.h}" viewBox="0 0 ${this.w} ${this.h}" aria-hidden="true">${this.s}</svg>` }
}
const triangle = (x, y) => `<path d="${mark('tension', x, y, 3.6)}" fill="var(--panel)" stroke="${F}" stroke-width="1.3"/>`
const told = (d, p) => `<b class="F">${number(p.F)}${TS}N</b> measured, ${number(p.e)} off<br>${fmt(p.L, 2)}${TS}cm, ${fmt(p.P, 2)}${TS}bar`

function tension (d, w, h) {
  const narrow = w < 480
  const top = d.top * 1.06; const p = new Plot(w, h, d.x, [0, top], { l: 52, r: 62, b: narrow ? 52 : 38 }).grid()
  const strong = new Set(d.labelled)
  d.curves.forEach((c, i) => p.line(c.x.map((x, j) => [x, c.y[j]]).filter(q => q[1] <= top), strong.has(i) ? 1.75 : 1, strong.has(i) ? 1 : 0.45))
  let last = Infinity
  const ends = d.curves.map((c, i) => ({ i, P: c.P, at: c.x.map((x, j) => [x, c.y[j]]).filter(q => q[1] <= top).at(-1) })).filter(e => e.at).sort((a, b) => b.P - a.P)
  let first = true
  for (const e of ends) {
    const y = p.Y(e.at[1])
    if (Math.abs(y - last) < 12 && last !== Infinity) continue
    last = y
    p.add(`<text class="tick" x="${p.X(e.at[0]) + 6}" y="${y + 4}" style="fill:var(--q-pressure);${strong.has(e.i) ? 'font-weight:600' : ''}">${fmt(e.P, 2)}${first ? `${TS}bar` : ''}</text>`)
    first = false
  }
  if (d.rest !== null) p.add(`<path d="M${p.X(d.rest)} ${p.Y(0)}v5" stroke="var(--ink)"/><text class="tick" x="${p.X(d.rest)}" y="${p.Y(0) + 28}" text-anchor="middle">rest length</text>`)
  for (const L of d.slack) p.add(`<circle cx="${p.X(L)}" cy="${p.Y(0)}" r="3.2" fill="var(--panel)" stroke="var(--ink-3)"/>`)
  const spots = d.points.map(q => [p.X(q.L), p.Y(q.F), told(d, q)])
  for (const s of spots) p.add(triangle(s[0], s[1]))
  if (d.source) p.add(`<text class="tick" x="${narrow ? 2 : 52}" y="${h - 2}">${escape(d.source)}</text>`)
  p.title(`${name('tension', 'Tension')}, N, against ${name('length', 'length')}, cm${narrow ? '' : `; beside the lines the ${name('pressure', 'pressure')}, bar`}`)
  return [p.svg(), spots]
}
function errors (d, w, h) {
  const most = Math.max(...d.points.map(q => Math.abs(q.e)), d.percent) * 1.12
  const p = new Plot(w, h, d.x, [-most, most], { l: 52, b: 38 })
  p.add(`<rect x="52" y="${p.Y(d.percent)}" width="${Math.max(0, w - 66)}" height="${Math.max(0, p.Y(-d.percent) - p.Y(d.percent))}" fill="var(--tint)"/>`).grid(v => (v > 0 ? '+' : '') + fmt(v, most < 5 ? 1 : 0))
  p.add(`<path d="M52 ${p.Y(0)}H${w - 14}" stroke="var(--edge)"/><text class="tick" x="${w - 18}" y="${p.Y(d.percent) - 4}" text-anchor="end">1${TS}% of the largest tension</text>`)
  const spots = d.points.map(q => [p.X(q.L), p.Y(q.e), told(d, q)])
  for (const s of spots) p.add(triangle(s[0], s[1]))
  p.title(`${name('tension', 'Tension')} measured less fitted, N, against ${name('length', 'length')}, cm`)
  return [p.svg(), spots]
}
function bubbles (d, w, h) {
  const most = Math.max(...d.points.map(q => Math.abs(q.e)), 1e-9); const size = e => Math.sqrt(Math.abs(e) / most) * 9
  const p = new Plot(w, h, d.x, [0, d.highest * 1.08], { l: 34, r: 78, b: 24, t: 24 }).grid()
  const spots = d.points.map(q => [p.X(q.L), p.Y(q.P), told(d, q)])
  const ring = (x, y, e) => `<circle cx="${x}" cy="${y}" r="${Math.max(1, size(e)).toFixed(1)}" fill="${e > 0 ? F : 'var(--panel)'}" fill-opacity="${e > 0 ? 0.8 : 1}" stroke="${F}" stroke-width="1.3"/>`
  d.points.forEach((q, i) => p.add(ring(spots[i][0], spots[i][1], q.e)))
  ;[most, most / 4, -most / 4, -most].forEach((e, i) => p.add(`${ring(w - 56, 44 + i * 30, e)}<text class="tick" x="${w - 42}" y="${48 + i * 30}">${e > 0 ? '+' : ''}${number(e, most < 20 ? 1 : 0)}${i ? '' : `${TS}N`}</text>`))
  p.add(`<text class="tick" x="4" y="14">${name('pressure', 'Pressure')}, bar, against ${name('length', 'length')}, cm</text>`)
  return [p.svg(), spots]
}
function left (d, w, h) {
  const most = Math.max(...d.left.map(q => Math.abs(q.e) / d.percent), 1) * 1.2
  const p = new Plot(w, h, [0, d.highest * 1.05], [-most, most], { l: 44, b: 34, t: 10 }).grid(v => `${v > 0 ? '+' : ''}${fmt(v, v % 1 ? 1 : 0)}${TS}%`)
  const spots = d.left.map(q => [p.X(q.P), p.Y(q.e / d.percent), `${fmt(q.P, 2)}${TS}bar left out<br><b class="F">${number(q.e)}${TS}N</b> off at ${fmt(q.L, 2)}${TS}cm`])
  for (const s of spots) p.add(`<path d="M${s[0]} ${p.Y(0)}V${s[1]}" stroke="${F}" stroke-width="3"/>`)
  p.add(`<path d="M44 ${p.Y(0)}H${w - 14}" stroke="var(--edge)"/><text class="tick" x="${w - 14}" y="${h - 4}" text-anchor="end">largest error, of the largest tension, against ${name('pressure', 'pressure')}, bar</text>`)
  return [p.svg(), spots]
}
// Length to the right, pressure into the depth, tension up; turned by dragging or with the arrows.
function surface (d, w, h, figure) {
  const turn = figure.turn ??= { a: -0.55, b: 0.5 }
  const { lengths, pressures, tension: z } = d.surface; const sa = Math.sin(turn.a); const ca = Math.cos(turn.a); const sb = Math.sin(turn.b); const cb = Math.cos(turn.b)
  const unit = (v, a, b) => (v - a) / (b - a || 1) - 0.5
  const size = Math.min(w * 0.62, h * 0.72)
  const at = (L, P, T) => {
    const x = unit(L, lengths[0], lengths.at(-1)); const y = unit(P, 0, d.highest); const u = clamp(T, 0, d.top) / d.top - 0.5
    const depth = -x * sa + y * ca
    return [w / 2 + (x * ca + y * sa) * size, h / 2 + 6 - (u * cb * 0.82 + depth * sb * 0.8) * size, depth]
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
  const h = +figure.dataset.height
  const [svg, spots] = KINDS[figure.dataset.kind](d, w, h, figure)
  figure.innerHTML = svg + '<div class="tip" hidden></div>'
  figure.spots = spots
}
function show (figure, i) {
  const tip = figure.querySelector('.tip'); const s = figure.spots?.[i]
  figure.querySelector('.ring')?.remove()
  figure.at = i
  if (!tip) return
  tip.hidden = !s
  if (!s) return
  tip.innerHTML = s[2]
  tip.style.left = `${clamp(s[0] + 12, 0, figure.clientWidth - tip.offsetWidth)}px`
  tip.style.top = `${Math.max(0, s[1] - tip.offsetHeight - 8)}px`
  figure.querySelector('svg').insertAdjacentHTML('beforeend', `<circle class="ring" cx="${s[0]}" cy="${s[1]}" r="8" fill="none" stroke="var(--ink)" stroke-width="1.5"/>`)
}
function near (figure, e) {
  const box = figure.getBoundingClientRect(); const x = e.clientX - box.left; const y = e.clientY - box.top
  let best = null
  ;(figure.spots ?? []).forEach((s, i) => { const r = (s[0] - x) ** 2 + (s[1] - y) ** 2; if (r < 625 && (!best || r < best[0])) best = [r, i] })
  show(figure, best ? best[1] : -1)
}
function ready (figure) {
  figure.onpointermove = e => {
    if (figure.from) {
      figure.turn = { a: figure.from.a + (e.clientX - figure.from.x) / 140, b: clamp(figure.from.b + (e.clientY - figure.from.y) / 200, 0.1, 1.3) }
      build(figure)
    } else near(figure, e)
  }
  figure.onpointerdown = e => { if (figure.dataset.kind === 'surface') { figure.from = { x: e.clientX, y: e.clientY, ...figure.turn }; figure.setPointerCapture(e.pointerId) } }
  figure.onpointerup = figure.onpointercancel = () => { figure.from = null }
  figure.onpointerleave = () => show(figure, -1)
  figure.onkeydown = e => {
    const step = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: -1, ArrowDown: 1 }[e.key]
    if (!step) return
    e.preventDefault(); e.stopPropagation()
    if (figure.dataset.kind === 'surface' && e.shiftKey) {
      const across = e.key === 'ArrowLeft' || e.key === 'ArrowRight'
      figure.turn = { a: figure.turn.a + (across ? step * 0.1 : 0), b: clamp(figure.turn.b + (across ? 0 : step * 0.1), 0.1, 1.3) }
      build(figure)
    } else show(figure, clamp((figure.at ?? -1) + step, 0, figure.spots.length - 1))
  }
}
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
