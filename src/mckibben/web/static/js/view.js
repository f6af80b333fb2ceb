// Zoom and pan, the same in every chart: wheel, drag, Shift and drag, two fingers, keys; a double click shows the whole again.
import { clamp } from './words.js'

const LEAST = 1e-4 // share of the whole that can be looked at
const STEP = 1.25 // of a key
const START = 4 // pixels after which a press is a drag

const scaled = ([a, b], k, f) => { const c = a + (b - a) * f; return [c - (c - a) * k, c + (b - c) * k] }
const moved = ([a, b], by) => [a + (b - a) * by, b + (b - a) * by]
/** A range within the whole, which may run downwards; null where it is the whole. */
function within ([a, b], [low, high]) {
  const wide = clamp((b - a) / (high - low), LEAST, 1)
  if (wide > 0.999) return null
  const start = clamp(((a + b) / 2 - low) / (high - low) - wide / 2, 0, 1 - wide)
  return [low + start * (high - low), low + (start + wide) * (high - low)]
}

/**
 * What part of a chart is shown.
 *
 * The chart has `whole()`, its ranges `{x, y}` without zoom, where y may be missing; `box()`, the rectangle of its field in the
 * window; `show(view)`, which draws other ranges, or the whole for null; perhaps `now()`, the ranges that are shown
 * where nobody has zoomed, `inside(event)`, whether an event is for the
 * field, `drags(event)`, whether a drag has another meaning there, and `zooms(factor)`, which takes a zoom over.
 */
export class View {
  constructor (surface, chart, keys = surface) {
    this.surface = surface; this.chart = chart; this.keys = keys; this.range = null; this.pointers = new Map(); this.drag = null
    surface.dataset.zooms = ''; keys.dataset.zooms = ''
    surface.zoomer = this
    const on = (name, do_, options) => surface.addEventListener(name, do_, options)
    on('wheel', e => this.wheel(e), { passive: false })
    on('pointerdown', e => this.down(e))
    on('pointermove', e => this.move(e))
    on('pointerup', e => this.up(e)); on('pointercancel', e => this.up(e))
    on('touchstart', e => { if (e.touches.length > 1 && this.for(e)) e.preventDefault() }, { passive: false })
    on('dblclick', e => { if (this.for(e)) this.reset() })
    on('click', e => { if (this.dragged) { e.stopPropagation(); e.preventDefault() } this.dragged = false }, true)
    keys.addEventListener('keydown', e => this.key(e))
    this.touch()
  }

  for (e) { return !this.chart.inside || this.chart.inside(e) }
  get now () { return this.range ?? this.chart.now?.() ?? this.chart.whole() }
  /** Place of an event as shares of the field, from its lower left corner. */
  place (e) { const b = this.chart.box(); return [(e.clientX - b.left) / b.width, 1 - (e.clientY - b.top) / b.height] }
  touch () { this.surface.style.touchAction = this.range ? 'none' : 'pan-x pan-y' }

  take (view) {
    const whole = this.chart.whole()
    if (this.chart.square) { // a drawing keeps its shape
      const share = (r, w) => (r[1] - r[0]) / (w[1] - w[0]); const wide = Math.max(share(view.x, whole.x), share(view.y, whole.y))
      const grown = (r, w) => { const mid = (r[0] + r[1]) / 2; const half = wide * (w[1] - w[0]) / 2; return [mid - half, mid + half] }
      view = { x: grown(view.x, whole.x), y: grown(view.y, whole.y) }
    }
    const x = within(view.x, whole.x); const y = whole.y && view.y ? within(view.y, whole.y) : null
    this.range = x || y ? { x: x ?? whole.x, ...(whole.y ? { y: y ?? whole.y } : {}) } : null
    this.told()
  }

  told () {
    this.touch()
    this.chart.show(this.range)
    this.surface.dispatchEvent(new CustomEvent('view', { bubbles: true, detail: this.range }))
  }

  reset () { this.range = null; this.told() }
  zoom (k, fx = 0.5, fy = 0.5) {
    if (this.chart.zooms?.(k)) return
    const { x, y } = this.now
    this.take({ x: scaled(x, k, fx), y: y && scaled(y, k, fy) })
  }

  pan (dx, dy) { const { x, y } = this.now; this.take({ x: moved(x, dx), y: y && moved(y, dy) }) }
  // A page is scrolled over its charts: the wheel is theirs with Ctrl, which a pinch on a pad sends too, or when they have the focus.
  wheel (e) {
    const at = document.activeElement
    if (!this.for(e) || !(e.ctrlKey || e.metaKey || this.keys === at || this.keys.contains(at))) return
    e.preventDefault()
    const lines = e.deltaMode ? 20 : 1
    this.zoom(Math.exp(clamp(e.deltaY * lines * (e.ctrlKey ? 0.004 : 0.0015), -0.5, 0.5)), ...this.place(e))
  }

  down (e) {
    this.dragged = false
    if (!this.for(e) || e.button) return
    this.pointers.set(e.pointerId, [e.clientX, e.clientY])
    if (this.pointers.size > 1) { this.drag = { kind: 'pinch', view: this.now, from: [...this.pointers.values()].map(p => [...p]) }; this.hold(e); return }
    const kind = e.shiftKey ? 'select' : this.chart.drags?.(e) ? '' : this.range || this.chart.now ? 'pan' : ''
    if (kind && (e.pointerType !== 'touch' || this.range)) this.drag = { kind, view: this.now, x: e.clientX, y: e.clientY }
  }

  hold (e) { try { this.surface.setPointerCapture(e.pointerId) } catch { /* it was let go meanwhile */ } }
  move (e) {
    if (!this.pointers.has(e.pointerId)) return
    this.pointers.set(e.pointerId, [e.clientX, e.clientY])
    const d = this.drag
    if (!d) return
    if (d.kind === 'pinch') { this.pinch(d); return }
    if (!this.dragged && Math.hypot(e.clientX - d.x, e.clientY - d.y) < START) return
    if (!this.dragged) { this.dragged = true; this.hold(e) }
    if (d.kind === 'select') { this.frame(d, e); return }
    const b = this.chart.box()
    this.take({ x: moved(d.view.x, (d.x - e.clientX) / b.width), y: d.view.y && moved(d.view.y, (e.clientY - d.y) / b.height) })
  }

  pinch (d) {
    const b = this.chart.box(); const now = [...this.pointers.values()]; this.dragged = true
    if (now.length < 2) return
    const apart = p => Math.max(20, Math.hypot(p[0][0] - p[1][0], p[0][1] - p[1][1])); const mid = (p, i) => (p[0][i] + p[1][i]) / 2
    const k = apart(d.from) / apart(now); const { x, y } = d.view
    const fx = (mid(d.from, 0) - b.left) / b.width; const fy = 1 - (mid(d.from, 1) - b.top) / b.height
    const dx = (mid(d.from, 0) - mid(now, 0)) / b.width; const dy = (mid(now, 1) - mid(d.from, 1)) / b.height
    this.take({ x: moved(scaled(x, k, fx), dx), y: y && moved(scaled(y, k, fy), dy) })
  }

  // The frame of what is chosen with Shift.
  frame (d, e) {
    const b = this.chart.box(); const flat = !d.view.y
    d.frame ??= document.body.appendChild(Object.assign(document.createElement('div'), { className: 'zoom-frame' }))
    d.to = [clamp(e.clientX, b.left, b.right), clamp(e.clientY, b.top, b.bottom)]
    const s = d.frame.style
    s.left = `${Math.min(d.x, d.to[0])}px`; s.width = `${Math.abs(d.x - d.to[0])}px`
    s.top = `${flat ? b.top : Math.min(d.y, d.to[1])}px`; s.height = `${flat ? b.height : Math.abs(d.y - d.to[1])}px`
  }

  up (e) {
    const d = this.drag
    this.pointers.delete(e.pointerId)
    this.drag = null
    d?.frame?.remove()
    if (d?.kind !== 'select' || !d.to || e.type === 'pointercancel' || Math.abs(d.to[0] - d.x) < START) return
    const [fx, fy] = this.place({ clientX: d.x, clientY: d.y }); const [gx, gy] = this.place({ clientX: d.to[0], clientY: d.to[1] })
    const part = ([a, b], f, g) => [a + (b - a) * Math.min(f, g), a + (b - a) * Math.max(f, g)]
    const { x, y } = d.view
    this.take({ x: part(x, fx, gx), y: y && Math.abs(fy - gy) > 0.01 ? part(y, fy, gy) : y })
  }

  key (e) {
    if (e.target.matches?.('input,select,textarea,summary')) return
    const by = { ArrowLeft: [-0.15, 0], ArrowRight: [0.15, 0], ArrowUp: [0, 0.15], ArrowDown: [0, -0.15] }[e.key]
    if (by && (e.ctrlKey || e.altKey)) this.pan(...by)
    else if (e.ctrlKey || e.metaKey || e.altKey) return
    else if (e.key === '+' || e.key === '=') this.zoom(1 / STEP)
    else if (e.key === '-') this.zoom(STEP)
    else if (e.key === '0') this.reset()
    else return
    e.preventDefault(); e.stopPropagation()
  }
}

/** Zoom of a drawing without axes: its svg is magnified. The svg may be another one at every time. */
export function magnify (surface, { find = () => surface.querySelector('svg'), ...more } = {}) {
  const size = svg => {
    svg.dataset.whole ??= svg.getAttribute('viewBox') ?? `0 0 ${svg.getAttribute('width')} ${svg.getAttribute('height')}`
    return svg.dataset.whole.split(/[\s,]+/).map(Number)
  }
  const view = new View(surface, {
    whole: () => { const svg = find(); const [x, y, w, h] = svg ? size(svg) : [0, 0, 1, 1]; return { x: [x, x + w], y: [y + h, y] } },
    box: () => (find() ?? surface).getBoundingClientRect(),
    inside: e => Boolean(e.target.closest?.('svg')),
    square: true,
    show: range => {
      const svg = find()
      if (!svg) return
      const [x, y, w, h] = size(svg)
      svg.setAttribute('viewBox', range ? `${range.x[0]} ${range.y[1]} ${range.x[1] - range.x[0]} ${range.y[0] - range.y[1]}` : `${x} ${y} ${w} ${h}`)
      svg.style.overflow = range ? 'hidden' : ''
    },
    ...more
  })
  return view
}

const boxOf = svg => (svg.getAttribute('viewBox') ?? `0 0 ${svg.clientWidth} ${svg.clientHeight}`).split(/[\s,]+/).map(Number)
/** Where an event is in a drawing, in its own units, magnified or not. */
export function inDrawing (svg, e) {
  const b = svg.getBoundingClientRect(); const [x, y, w, h] = boxOf(svg)
  return [x + (e.clientX - b.left) / b.width * w, y + (e.clientY - b.top) / b.height * h]
}
/** Pixels from the upper left corner of a drawing to a place in its own units. */
export function fromDrawing (svg, [px, py]) {
  const b = svg.getBoundingClientRect(); const [x, y, w, h] = boxOf(svg)
  return [(px - x) / w * b.width, (py - y) / h * b.height]
}
