// Small drawings in SVG with words where they belong, for pages whose pictures are more than lines: axes, paths, corners, a value under the pointer.
import { events } from './lab.js'
import { View } from './view.js'
import { TS, clamp, digits, ends, escape, fmt, row, weight } from './words.js'

export const nice = (low, high, count = 6) => {
  [low, high] = ends(low, high)
  const raw = (high - low) / Math.max(1, count); const size = 10 ** Math.floor(Math.log10(raw))
  const step = [1, 2, 2.5, 5, 10].find(m => m * size >= raw * 0.999) * size
  const ticks = row(Math.ceil(low / step - 1e-9) * step, step, high, 100).map(v => Math.abs(v) < step * 1e-9 ? 0 : v)
  return { step, ticks, places: digits(step) }
}
const pathOf = points => points.length ? 'M' + points.map(([x, y]) => `${x.toFixed(1)} ${y.toFixed(1)}`).join('L') : ''

let count = 0
export class Plot {
  /** @param place that it is drawn into, which keeps the part that is shown of it */
  constructor (w, h, x, y, margin = {}, place = null) {
    Object.assign(this, { w, h, x: place?.zoomed?.x ?? x, y: place?.zoomed?.y ?? y, whole: { x, y }, m: { t: 28, r: 16, b: 38, l: 44, ...margin }, s: '', lines: [], part: place?.zoomed ?? null })
    if (!this.part) return
    this.clip = `url(#field-${++count})`
    this.s = `<clipPath id="field-${count}"><rect x="${this.m.l}" y="${this.m.t}" width="${this.wide}" height="${this.high}"/></clipPath>`
  }

  get wide () { return Math.max(1, this.w - this.m.l - this.m.r) }
  get high () { return Math.max(1, this.h - this.m.t - this.m.b) }
  /** Whether something at a place in the units of the axes is shown. */
  shows (x, y) { return !this.part || (x >= this.x[0] && x <= this.x[1] && y >= this.y[0] && y <= this.y[1]) }
  /** The attribute of what ends at the edges of the field. */
  get cut () { return this.clip ? ` clip-path="${this.clip}"` : '' }

  X (v) { return this.m.l + (v - this.x[0]) / (this.x[1] - this.x[0]) * (this.w - this.m.l - this.m.r) }
  Y (v) { return this.h - this.m.b - (v - this.y[0]) / (this.y[1] - this.y[0]) * (this.h - this.m.t - this.m.b) }
  add (s) { this.s += s; return this }
  grid (xn = 6, yn = 6) {
    const gx = nice(...this.x, Math.min(xn, Math.floor((this.w - 60) / 44))); const gy = nice(...this.y, yn)
    for (const v of gx.ticks) { const X = this.X(v).toFixed(1); this.s += `<path d="M${X} ${this.m.t}V${this.h - this.m.b}" stroke="var(--grid)"/><text class="tick" x="${X}" y="${this.h - this.m.b + 14}" text-anchor="middle">${fmt(v, gx.places)}</text>` }
    for (const v of gy.ticks) { const Y = this.Y(v).toFixed(1); this.s += `<path d="M${this.m.l} ${Y}H${this.w - this.m.r}" stroke="var(--grid)"/><text class="tick" x="${this.m.l - 6}" y="${+Y + 4}" text-anchor="end">${fmt(v, gy.places)}</text>` }
    return this
  }

  /** A line; with a name its points are in the table and under the pointer. */
  line (x, y, { c = 'var(--ink)', w = 1.75, d = '', fill = 'none', close = false, name = '', o = 1 } = {}) {
    const points = x.map((v, i) => [this.X(v), this.Y(y[i])])
    this.s += `<path d="${pathOf(points)}${close ? 'z' : ''}" fill="${fill}" stroke="${c}" stroke-width="${weight(w)}" stroke-linejoin="round"${d ? ` stroke-dasharray="${d}"` : ''}${o < 1 ? ` opacity="${o}"` : ''}${this.cut}/>`
    if (name) this.lines.push({ name, x, y })
    return this
  }

  text (x, y, words, { dx = 0, dy = 0, a = 'start', k = 'lab', f = '' } = {}) {
    if (!this.shows(x, y)) return this
    return this.add(`<text class="${k}" x="${(this.X(x) + dx).toFixed(1)}" y="${(this.Y(y) + dy).toFixed(1)}" text-anchor="${a}"${f ? ` style="${f}"` : ''}>${words}</text>`)
  }

  dot (x, y, { r = 3.5, fill = 'var(--panel)' } = {}) {
    if (!this.shows(x, y)) return this
    return this.add(`<circle cx="${this.X(x).toFixed(1)}" cy="${this.Y(y).toFixed(1)}" r="${r}" fill="${fill}" stroke="var(--ink)" stroke-width="1.5"/>`)
  }

  frame (yTitle, xTitle) {
    return this.add(`<rect x="${this.m.l}" y="${this.m.t}" width="${Math.max(0, this.w - this.m.l - this.m.r)}" height="${Math.max(0, this.h - this.m.t - this.m.b)}" fill="none" stroke="var(--rule)"/><text class="tick" x="${this.m.l}" y="${this.m.t - 9}">${yTitle}</text><text class="tick" x="${this.w - this.m.r}" y="${this.h - 4}" text-anchor="end">${xTitle}</text>`)
  }

  /** Put it into a place, with a summary, a table of its values, and the value under the pointer or the arrows. */
  into (place, name, summary, heads) {
    if (!place.querySelector('.drawn')) place.innerHTML = '<div class="drawn" tabindex="0" role="img"></div><details class="values"><summary>Table of values</summary><div class="scroll"></div></details>'
    const box = place.querySelector('.drawn') // it stays while the chart is zoomed, so that a drag and the focus stay
    box.setAttribute('aria-label', `${name}. ${summary}`)
    box.innerHTML = `<svg width="${this.w}" height="${this.h}" viewBox="0 0 ${this.w} ${this.h}" aria-hidden="true">${this.s}<circle class="cursor" r="4" fill="none" stroke="var(--ink)" stroke-width="1.5" hidden/></svg><div class="tip" hidden></div>`
    const tip = box.querySelector('.tip'); const ring = box.querySelector('.cursor')
    zooms(place, box, this)
    const show = (l, i) => {
      tip.hidden = ring.toggleAttribute('hidden', !l)
      if (!l) return
      tip.textContent = `${fmt(l.x[i], heads[0].places)}${TS}${heads[0].unit}, ${fmt(l.y[i], heads[1].places)}${heads[1].unit ? TS + heads[1].unit : ''}${this.lines.length > 1 ? ` \u00b7 ${l.name}` : ''}`
      const X = this.X(l.x[i]); const Y = this.Y(l.y[i])
      ring.setAttribute('cx', X); ring.setAttribute('cy', Y)
      tip.style.left = `${clamp(X + 8, 0, Math.max(0, this.w - tip.offsetWidth))}px`
      tip.style.top = `${Math.max(0, Y - 34)}px`
    }
    box.onpointermove = e => {
      const at = box.getBoundingClientRect(); let best = null
      for (const l of this.lines) for (let i = 0; i < l.x.length; i++) { if (!this.shows(l.x[i], l.y[i])) continue; const d = (this.X(l.x[i]) - e.clientX + at.left) ** 2 + (this.Y(l.y[i]) - e.clientY + at.top) ** 2; if (d < 900 && !(best?.d <= d)) best = { d, l, i } }
      show(best?.l, best?.i)
    }
    box.onpointerleave = () => show(null)
    const at = { line: 0, i: -1 }
    box.onkeydown = e => {
      const step = { ArrowLeft: -1, ArrowRight: 1 }[e.key] ?? 0; const other = { ArrowUp: -1, ArrowDown: 1 }[e.key] ?? 0
      if ((!step && !other) || e.ctrlKey || e.altKey) return
      e.preventDefault(); e.stopPropagation()
      at.line = clamp(at.line + other, 0, this.lines.length - 1)
      const l = this.lines[at.line]
      at.i = clamp(at.i + step * (e.shiftKey ? 10 : 1), 0, l.x.length - 1)
      show(l, at.i)
    }
    const details = place.querySelector('details')
    details.ontoggle = () => { if (details.open) this.table(details.querySelector('.scroll'), heads) }
    if (details.open) details.ontoggle()
  }

  table (place, heads) {
    const rows = this.lines.flatMap(l => l.x.map((v, i) => `<tr><td>${escape(l.name)}</td><td class="num">${fmt(v, heads[0].places)}</td><td class="num">${fmt(l.y[i], heads[1].places)}</td></tr>`))
    place.innerHTML = `<table><thead><tr><th>Line</th>${heads.map(h => `<th class="num">${escape(h.name)}${h.unit ? `, ${escape(h.unit)}` : ''}</th>`).join('')}</tr></thead><tbody>${rows.join('')}</tbody></table>`
  }
}

/** Zoom and pan of a plot: its place keeps the part, and `redraw` of the place draws it. */
export function zooms (place, surface, plot) {
  surface.plot = plot
  surface.zoomer ??= new View(surface, {
    whole: () => surface.plot.whole,
    box: () => { const b = surface.querySelector('svg').getBoundingClientRect(); const { m, wide, high, w } = surface.plot; const k = b.width / w || 1; return { left: b.left + k * m.l, top: b.top + k * m.t, right: b.left + k * (m.l + wide), bottom: b.top + k * (m.t + high), width: k * wide, height: k * high } },
    inside: e => Boolean(e.target.closest?.('svg')),
    show: part => { place.zoomed = part; place.redraw() }
  })
}

/** Draw what stands in `data-spec` of the places, whenever it, the width or the theme changes. */
export function draws (selector, draw) {
  const seen = new Map()
  const sizes = new ResizeObserver(list => { for (const { target } of list) if (seen.get(target)?.width !== target.clientWidth) one(target) })
  const one = place => {
    const width = place.clientWidth
    if (!width || !place.dataset.spec) return
    seen.set(place, { spec: place.dataset.spec, width })
    place.redraw = () => draw(place, JSON.parse(place.dataset.spec), width)
    place.redraw()
  }
  events.addEventListener('projector', () => { for (const place of seen.keys()) place.redraw?.() })
  const look = () => {
    for (const place of document.querySelectorAll(selector)) {
      if (!seen.has(place)) { seen.set(place, {}); sizes.observe(place) }
      if (seen.get(place).spec !== place.dataset.spec) one(place)
    }
    for (const place of seen.keys()) if (!place.isConnected) { sizes.unobserve(place); seen.delete(place) }
  }
  let due = false
  new MutationObserver(() => { if (!due) { due = true; requestAnimationFrame(() => { due = false; look() }) } })
    .observe(document.documentElement, { childList: true, subtree: true, attributes: true, attributeFilter: ['data-spec'] })
  look()
}
