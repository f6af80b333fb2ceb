// Strip charts: five lanes over one time axis, with what is asked, what is allowed, the newest value, and one cursor.
import uPlot from '../uplot/uPlot.esm.js'
import { axis, dot, stroke } from './charts.js'
import { View } from './view.js'
import { Q, RESIDUAL, TS, clamp, ends, fmt, keySign, projected, row, size, token, weight } from './words.js'

const LANES = ['valve', 'flow', 'pressure', 'tension', 'length']
const HIGH = { valve: 52, flow: 68, pressure: 82, tension: 100, length: 82, residual: 62 }
const PHONE = { order: ['pressure', 'tension', 'length', 'flow'], high: { pressure: 86, tension: 96, length: 86, flow: 56, residual: 56 } }
const NAMED = { ...Q, residual: RESIDUAL }
const OTHER = [6, 3] // the dash of the second recording of a quantity
const foot = () => size(24)
const LEAST = { valve: 20, flow: 5, pressure: 0.5, tension: 5, length: 0.4, residual: 1 }

export class Strips {
  /** @param place element @param buffer of the newest samples */
  constructor (place, buffer) {
    this.place = place.querySelector('.lanes'); this.host = place; this.buffer = buffer
    this.plots = new Map(); this.width = 0; this.view = { a: 0, b: 6 }; this.cursor = null
    this.zoom = 6; this.held = null; this.ranges = {}; this.source = null; this.trip = null; this.limits = {}; this.old = false
    this.frames = 0
    const sizes = new ResizeObserver(() => this.build())
    sizes.observe(this.place); sizes.observe(place.parentElement)
    this.place.addEventListener('pointermove', e => this.point(e))
    this.place.addEventListener('pointerleave', () => { if (!this.pinned) { this.cursor = null; this.dirty = true } })
    this.place.addEventListener('click', e => { this.point(e); this.pinned = !this.pinned })
    this.dirty = true
    const field = () => { const b = this.place.getBoundingClientRect(); return { left: b.left + this.left, right: b.right - this.right, width: b.width - this.left - this.right, top: b.top, bottom: b.bottom, height: b.height } }
    // `zooms` of the page: how long the window is that follows the newest sample
    this.zoomer = new View(this.place, { whole: () => this.reach(), now: () => ({ x: [this.view.a, this.view.b] }), box: field, zooms: k => this.follows?.(k), show: range => { this.held = range ? { a: range.x[0], b: range.x[1] } : null; if (!range) this.reset?.(); this.dirty = true } }, place)
    this.place.zoomer = this.zoomer
  }

  /** All times that there are to be seen: of the dry run, or of what was sampled. */
  reach () { return { x: this.source ? [0, Math.max(this.view.b, this.source.time.at(-1))] : [this.buffer.n ? Math.min(this.view.a, this.buffer.t[0]) : 0, Math.max(this.view.b, this.buffer.end, 1e-3)] } }
  get phone () { return innerWidth <= 760 }

  build () {
    const w = Math.floor(this.place.clientWidth)
    const share = this.room()
    const left = Boolean(this.own?.data?.t)
    if (!w || (w === this.width && left === this.shows && Math.abs(share - this.share) < 0.03)) return
    this.width = w; this.share = share; this.shows = left
    for (const p of this.plots.values()) p.destroy()
    this.plots.clear(); this.place.replaceChildren()
    const phone = this.phone; const order = [...(phone ? PHONE.order : LANES)]
    if (left) order.splice(order.indexOf('tension') + 1, 0, 'residual')
    this.left = phone ? 54 : size(112); this.right = phone ? size(56) : size(74)
    if (!phone) { this.steps = document.createElement('canvas'); this.steps.className = 'steps'; this.steps.setAttribute('role', 'img'); this.said = 'Steps: '; this.steps.setAttribute('aria-label', this.said); this.place.append(this.steps) } else this.steps = null
    order.forEach((q, i) => this.lane(q, phone ? PHONE.high[q] : Math.round(HIGH[q] * share), i === order.length - 1))
    this.tag = document.createElement('div'); this.tag.className = 'when'; this.tag.hidden = true; this.place.append(this.tag)
    this.dirty = true
  }

  // The lanes fill what the column has, between three quarters and half as much again of their usual heights.
  room () {
    const column = this.host.parentElement
    if (this.phone || projected() || getComputedStyle(column).overflowY !== 'auto') return projected() ? 1.25 : 1
    const other = [...column.children].filter(e => e !== this.host && !e.classList.contains('dock')).reduce((a, e) => a + e.offsetHeight, 0)
    return clamp((column.clientHeight - other - 22 - foot() - 124) / Object.entries(HIGH).reduce((a, [q, h]) => a + (q === 'residual' && !this.own?.data?.t ? 0 : h), 0), 0.6, 1.5)
  }

  lane (q, high, last) {
    const box = document.createElement('div'); box.className = high > 60 ? 'lane tall' : 'lane'; box.dataset.quantity = q
    const name = this.phone ? `<i>${NAMED[q].sign}</i>` : NAMED[q].name
    box.innerHTML = `<div class="name" style="color:var(--q-${q})">${this.phone || q === 'residual' ? '' : keySign(q, 24)}<b>${name}</b> <span class="faint">${NAMED[q].unit}</span></div>`
    this.place.append(box)
    const plot = new uPlot({
      width: this.width, height: high + (last ? foot() : 0), padding: [7, this.right, last ? 0 : 7, 0], legend: { show: false }, cursor: { show: false }, select: { show: false },
      scales: { x: { time: false, auto: false, range: (u, a, b) => [a ?? this.view.a, b ?? this.view.b] }, y: { auto: false, range: (u, a, b) => [a ?? 0, b ?? 1] } },
      series: [{}, { paths: () => null, points: { show: false } }],
      axes: [axis({ size: last ? 24 : 0, show: true, space: 60, values: (u, ticks) => last ? this.times(ticks) : ticks.map(() => '') }), axis({ size: this.left / size(1), gap: 6, space: 15, ...(q === 'flow' || q === 'residual' ? { splits: u => even(u.scales.y.max) } : {}), values: (u, ticks) => ticks.map(v => fmt(v, Number.isInteger(v) ? 0 : 1)) })],
      hooks: { draw: [u => this.over(u, q)] }
    }, [[0, 1], [0, 1]], box)
    this.plots.set(q, plot)
  }

  times (ticks) {
    const d = ticks.length > 1 && ticks[1] - ticks[0] < 0.99 ? (ticks[1] - ticks[0] < 0.0999 ? 2 : 1) : 0
    return ticks.map((t, i) => fmt(t, d) + (!this.phone || i === ticks.length - 1 ? `${TS}s` : ''))
  }

  /** Lanes' ends, wide enough for what is expected and what came. */
  range (q, low, high) {
    const before = this.ranges[q]; const least = LEAST[q]
    if (!Number.isFinite(low) || !Number.isFinite(high)) { this.ranges[q] ??= q === 'flow' ? [-least, least] : [0, least]; return }
    if (q === 'flow' || q === 'residual') { const m = Math.max(least, -low, high) * 1.15; low = -m; high = m } else if (q === 'length') { const room = Math.max(least, high - low) * 0.16; low -= room; high += room } else { low = Math.min(0, low); high = Math.max(least, high * 1.14) }
    const limit = this.limits[q]
    if (limit && limit > low && limit <= high * 1.3 && q !== 'length') high = Math.max(high, limit * 1.06)
    if (before && before[0] <= low && before[1] >= high && (before[1] - before[0]) < 1.8 * (high - low)) return
    this.ranges[q] = ends(low, high)
  }

  /** What is drawn now: the stream, or what the dry run expects. */
  draw (now) {
    this.build()
    const { a, b } = this.view
    for (const [q, u] of this.plots) {
      const [low, high] = this.ranges[q] ?? [0, 1]
      u.batch(() => { u.setScale('x', { min: a, max: b }); u.setScale('y', { min: low, max: high }) })
    }
    if (this.steps) this.drawSteps()
    this.frames++; this.total = (this.total ?? 0) + 1
    this.dirty = false
  }

  over (u, q) {
    const { ctx, bbox } = u; const px = devicePixelRatio; const y = v => u.valToPos(v, 'y', true); const x = t => u.valToPos(t, 'x', true)
    const left = bbox.left; const right = bbox.left + bbox.width
    ctx.save()
    ctx.font = `${size(11) * px}px ${token('--font')}`; ctx.textBaseline = 'middle'; ctx.textAlign = 'left'
    const limit = this.limits[q]; const [low, high] = this.ranges[q] ?? [0, 1]
    if (limit && limit < high && limit > low) {
      const red = this.trip?.quantity === q
      stroke(ctx, [left, right], [y(limit), y(limit)], { colour: token(red ? '--stop' : '--ink-2'), width: red ? 1.5 : 1, dash: red ? [] : [1, 3] })
      if (!this.phone) { ctx.fillStyle = token(red ? '--stop-ink' : '--ink-3'); ctx.fillText(red ? `interlock ${fmt(limit, NAMED[q].limit)}${TS}${NAMED[q].unit}` : q === 'tension' ? 'limit of the load cell' : 'limit', left + 6 * px, y(limit) + (red ? -7 : 8) * px) }
    }
    if (q === 'flow' || q === 'residual') stroke(ctx, [left, right], [y(0), y(0)], { colour: token('--edge'), width: 1 })
    this.lines(u, q, low, high)
    if (!this.source && this.buffer.n && q !== 'residual') {
      const t = Math.min(this.view.b, this.buffer.end); const k = this.buffer.at(t); const v = this.buffer.c[q][k]
      if (Number.isFinite(v) && t >= this.view.a) {
        const yy = clamp(y(clamp(v, low, high)), bbox.top + 5 * px, bbox.top + bbox.height - 3 * px)
        dot(ctx, q, x(t), yy, 4)
        ctx.font = `600 ${size(this.phone ? 13 : 15) * px}px ${token('--font')}`; ctx.fillStyle = this.old ? token('--ink-2') : token(`--q-${q}`)
        // the newest value is that of the read-outs, ten times a second; an older stretch has none, but under the cursor
        if ((!this.held && !this.trip) || this.buffer.end <= this.view.b + 1e-9) ctx.fillText(fmt(this.told?.[q] ?? v, NAMED[q].places), right + 10 * px, yy)
      }
    }
    if (q === 'residual' && this.own?.data) {
      const { rms, n } = this.own.last ?? {}
      ctx.font = `600 ${size(this.phone ? 11 : 13) * px}px ${token('--font')}`; ctx.fillStyle = token('--ink')
      if (n > 1) ctx.fillText(`rms ${fmt(rms, 1)}`, right + 6 * px, bbox.top + bbox.height / 2)
    }
    if (this.trip) stroke(ctx, [x(this.trip.time), x(this.trip.time)], [0, ctx.canvas.height], { colour: token('--stop'), width: 2 })
    this.atCursor(u, q, x, y, low, high)
    ctx.restore()
  }

  // The line of a lane, and what was asked for: at most four points of every column of pixels, so that no peak is lost.
  lines (u, q, low, high) {
    const { ctx, bbox } = u; const px = devicePixelRatio; const dry = this.source; const b = this.buffer
    let t; let v; let s; let i = 0; let j
    if (dry) { t = dry.time; v = dry[q]; j = t.length } else { t = b.t; v = b.c[q]; s = b.c[`set_${q}`]; [i, j] = b.between(this.view.a, this.view.b) }
    const kx = bbox.width / (this.view.b - this.view.a); const ky = bbox.height / (high - low)
    ctx.save()
    ctx.beginPath(); ctx.rect(bbox.left, bbox.top - 6 * px, bbox.width, bbox.height + 12 * px); ctx.clip()
    ctx.lineJoin = 'bevel'
    const put = (values, colour, width, dash, alpha, shift = 0) => {
      ctx.strokeStyle = colour; ctx.lineWidth = weight(width) * px; ctx.setLineDash(dash.map(d => d * px)); ctx.globalAlpha = alpha
      ctx.beginPath()
      let pen = false; let column = NaN; let least = 0; let most = 0; let lastY = 0; let lastX = 0
      const flush = () => { if (most - least > 1) { ctx.lineTo(lastX, least); ctx.lineTo(lastX, most) } ctx.lineTo(lastX, lastY) }
      for (let k = i; k < j; k++) {
        const value = values[k]
        if (value === null || value !== value) { if (pen) flush(); pen = false; continue }
        const x = bbox.left + (t[k] + shift - this.view.a) * kx; const y = clamp(bbox.top + bbox.height - (value - low) * ky, -1e5, 1e5)
        const c = x | 0
        if (!pen) { ctx.moveTo(x, y); pen = true; column = c; least = most = y } else if (c !== column) { flush(); column = c; least = most = y } else { if (y < least) least = y; if (y > most) most = y }
        lastX = x; lastY = y
      }
      if (pen) flush()
      ctx.stroke()
    }
    if (s) put(s, token('--ink-3'), 1, [3, 2], 1)
    if (v && j - i > 1) put(v, this.old ? token('--ink-2') : token(`--q-${q}`), q === 'tension' ? 2.2 : 1.75, dry ? DRY : [], dry ? 0.75 : 1)
    const own = this.own?.data?.t ? this.own : null
    if (own && (own.data[q] || q === 'residual')) {
      t = own.data.t; [i, j] = own.between(this.view.a, this.view.b)
      const values = q === 'residual' ? { length: t.length } : own.data[q]
      if (q === 'residual') for (let k = i; k < j; k++) values[k] = own.left('tension', k)
      put(values, token(q === 'residual' ? '--ink' : `--q-${q}`), dry ? 2 : 1.5, q === 'residual' || dry ? [] : OTHER, 1, own.shift)
      if (q === 'tension') { ctx.setLineDash([]); ctx.fillStyle = token('--q-tension'); ctx.font = `600 ${size(11) * px}px ${token('--font')}`; ctx.textAlign = 'right'; ctx.fillText(dry ? 'solid: measured' : 'dashed: measured', bbox.left + bbox.width - 4 * px, bbox.top + 6 * px) }
    }
    ctx.restore()
  }

  atCursor (u, q, x, y, low, high) {
    if (this.cursor === null || this.cursor < this.view.a || this.cursor > this.view.b) return
    const { ctx, bbox } = u; const px = devicePixelRatio; const cx = x(this.cursor)
    stroke(ctx, [cx, cx], [0, bbox.top + bbox.height + 7 * px], { colour: token('--ink'), width: 1 })
    const v = this.value(q, this.cursor)
    if (!Number.isFinite(v)) return
    const cy = y(clamp(v, low, high)); const w = size(42) * px; const h = size(17) * px; const bx = cx + w + 6 * px > bbox.left + bbox.width ? cx - w - 3 * px : cx + 3 * px
    ctx.fillStyle = token('--panel'); ctx.strokeStyle = token(`--q-${q}`); ctx.lineWidth = px
    ctx.beginPath(); ctx.roundRect(bx, cy - h / 2, w, h, 3 * px); ctx.fill(); ctx.stroke()
    ctx.font = `600 ${size(11) * px}px ${token('--font')}`; ctx.textAlign = 'center'; ctx.fillStyle = token(`--q-${q}`); ctx.fillText(fmt(v, NAMED[q].places), bx + w / 2, cy + px)
  }

  /** What the lanes show, as the document of charts over one time. */
  document () {
    const { a, b } = this.view; const dry = this.source; const buffer = this.buffer
    const charts = [...this.plots.keys()].map(q => {
      const t = dry ? dry.time : buffer.t; const [i, j] = dry ? [0, t.length] : buffer.between(a, b); const step = Math.max(1, Math.floor((j - i) / 2500)); const at = row(i, step, j - 1, 5000)
      const line = (values, more) => ({ x: at.map(k => t[k]), y: at.map(k => Number.isFinite(values[k]) ? values[k] : null), ...more })
      const values = dry ? dry[q] : buffer.c[q]; const set = dry ? null : buffer.c[`set_${q}`]; const [low, high] = this.ranges[q] ?? [null, null]
      const lines = [...(set ? [line(set, { dash: 'B', width: 1, quantity: '' })] : []), ...(values ? [line(values, { quantity: q, dash: dry ? 'B' : '' })] : [])]
      const own = this.own?.data?.t && (this.own.data[q] || q === 'residual') ? this.own : null
      if (own) {
        const [k0, k1] = own.between(a, b); const ks = row(k0, Math.max(1, Math.floor((k1 - k0) / 2500)), k1 - 1, 5000); const values = ks.map(k => q === 'residual' ? own.left('tension', k) : own.data[q][k])
        lines.push({ x: ks.map(k => own.data.t[k] + own.shift), y: values.map(v => Number.isFinite(v) ? v : null), quantity: Q[q] ? q : '', dash: q === 'residual' ? '' : 'B', width: 1.5 })
      }
      return { name: NAMED[q].name, x: { label: 'Time', unit: 's', low: a, high: b }, y: { label: NAMED[q].name, unit: NAMED[q].unit, quantity: Q[q] ? q : '', low, high }, lines, marks: [] }
    })
    return { name: dry ? 'Dry run' : 'Run', charts }
  }

  /** Value of a channel at a time, in displayed units. */
  value (q, time) {
    const dry = this.source
    if (q === 'residual') { const own = this.own; const k = own?.data?.t ? own.between(time, time)[0] : -1; return k >= 0 && k < own.data.t.length ? own.left('tension', k) : NaN }
    if (!dry) return this.buffer.n && time <= this.buffer.end + 1e-9 && time >= this.buffer.t[0] ? this.buffer.c[q][this.buffer.at(time)] : NaN
    let i = dry.time.findIndex(t => t > time); i = i < 0 ? dry.time.length - 1 : Math.max(0, i - 1)
    return dry[q]?.[i] ?? NaN
  }

  drawSteps () {
    const px = devicePixelRatio; const w = this.width; const c = this.steps
    if (c.width !== Math.round(w * px)) { c.width = Math.round(w * px); c.height = Math.round(22 * px); c.style.width = `${w}px`; c.style.height = '22px' }
    const g = c.getContext('2d'); g.setTransform(px, 0, 0, px, 0, 0); g.clearRect(0, 0, w, 22)
    const { a, b } = this.view; const x = t => this.left + (t - a) / (b - a) * (w - this.left - this.right)
    g.font = `${size(11)}px ${token('--font')}`; g.textAlign = 'center'; g.textBaseline = 'middle'
    const now = this.source ? -1 : this.buffer.end; const said = []
    const put = (t0, t1, text, short) => {
      const u0 = Math.max(a, t0); const u1 = Math.min(b, t1)
      if (x(u1) - x(u0) < 2) return
      const on = now >= t0 && now <= t1 + 1e-9 && !this.done && !this.source
      g.fillStyle = token(on ? '--ink' : '--sunken'); g.fillRect(x(u0) + 0.5, 2, Math.max(0, x(u1) - x(u0) - 1), 16)
      const room = x(u1) - x(u0)
      g.fillStyle = token(on ? '--on-ink' : '--ink-2')
      const words = g.measureText(text).width + 8 < room ? text : g.measureText(short).width + 8 < room ? short : ''
      if (words) g.fillText(words, (x(u0) + x(u1)) / 2, 10.5)
      said.push(text)
    }
    for (const s of this.lanes ?? []) {
      const end = s.end ?? Math.max(now, s.start)
      if (end < a || s.start > b) continue
      if (!s.period || (end - s.start) / s.period > 400) { put(s.start, end, s.label, s.label.slice(0, 6)); continue }
      const first = Math.max(0, Math.floor((a - s.start) / s.period))
      for (const i of row(first, 1, (Math.min(end, b) - s.start) / s.period - 1e-9)) put(s.start + i * s.period, Math.min(end, s.start + (i + 1) * s.period), `cycle ${i + 1}`, String(i + 1))
    }
    if (this.trip && this.trip.time >= a && this.trip.time <= b) {
      g.fillStyle = token('--stop'); g.fillRect(x(this.trip.time) - 2, 0, 96, 18); g.fillStyle = token('--on-stop'); g.font = `600 ${size(11)}px ${token('--font')}`
      g.fillText(`${this.trip.word} ${fmt(this.trip.time, 3)}${TS}s`, x(this.trip.time) + 46, 9.5)
    }
    const label = `Steps: ${said.join(', ')}`
    if (this.said !== label) { this.said = label; c.setAttribute('aria-label', label) }
  }

  point (e) {
    const box = this.place.getBoundingClientRect(); const x = e.clientX - box.left
    if (e.type === 'pointermove' && this.pinned) return
    const t = this.view.a + (x - this.left) / (this.width - this.left - this.right) * (this.view.b - this.view.a)
    this.cursor = x < this.left || x > this.width - this.right ? null : t
    this.dirty = true
  }

  /** The cursor by samples; from the newest one on. */
  step (samples) {
    const p = this.source ? 0.01 : this.buffer.period
    this.cursor = clamp((this.cursor ?? Math.min(this.view.b, this.source ? this.view.b : this.buffer.end)) + samples * p, this.view.a, this.source ? this.view.b : Math.min(this.view.b, this.buffer.end))
    this.pinned = true; this.dirty = true
  }

  home (end) { this.cursor = end ? (this.source ? this.view.b : Math.min(this.view.b, this.buffer.end)) : this.view.a; this.pinned = true; this.dirty = true }

  showWhen () {
    const t = this.cursor; const on = t !== null && t >= this.view.a && t <= this.view.b
    this.tag.hidden = !on
    if (!on) return
    this.tag.textContent = `${fmt(t, 3)}${TS}s`
    this.tag.style.left = `${this.left + (t - this.view.a) / (this.view.b - this.view.a) * (this.width - this.left - this.right)}px`
  }
}
const even = high => { const p = 10 ** Math.floor(Math.log10(high * 0.9)); const m = Math.floor(high * 0.9 / p) * p; return [-m, 0, m] }
const DRY = [4, 3]
