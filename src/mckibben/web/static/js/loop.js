// Tension against length, live: the loop of the last cycle filled, the present one growing, the law behind it.
import uPlot from '../uplot/uPlot.esm.js'
import { arrows, axis, dot, stroke } from './charts.js'
import { View } from './view.js'
import { TS, ends, fmt, size, token } from './words.js'

export class LoopPlot {
  constructor (place, buffer) {
    this.place = place; this.buffer = buffer; this.laws = null; this.dry = null; this.plot = null; this.width = 0
    this.reach = [NaN, NaN]; this.x = [12, 16]; this.y = [0, 100]; this.period = 0; this.work = null; this.cursor = null; this.old = false; this.words = ''
    this.part = null
    new ResizeObserver(() => { this.dirty = true }).observe(place)
    this.zoomer = new View(place, { whole: () => ({ x: this.x, y: this.y }), box: () => this.plot.over.getBoundingClientRect(), inside: e => this.plot?.over.contains(e.target), show: part => { this.part = part; this.dirty = true; this.changed?.() } })
  }

  build () {
    const w = Math.floor(this.place.clientWidth)
    if (!w || (this.plot && w === this.width && size(1) === this.scale)) return
    this.width = w; this.scale = size(1)
    this.plot?.destroy()
    this.plot = new uPlot({
      width: w, height: innerWidth <= 760 ? 320 : innerHeight < 860 ? 258 : 288, padding: [6, size(46), 0, 0], legend: { show: false }, cursor: { show: false }, select: { show: false },
      scales: { x: { time: false, range: () => this.part?.x ?? this.x }, y: { range: () => this.part?.y ?? this.y } }, series: [{}, { paths: () => null, points: { show: false } }],
      axes: [axis({ size: 34, space: 50 }), axis({ size: 44, space: 34 })], hooks: { draw: [u => this.over(u)] }
    }, [[0, 1], [0, 1]], this.place)
  }

  /** From the law and what is expected: where the axes end. */
  fit (highest, limit) {
    const laws = this.laws
    if (!laws) return
    this.x = [laws.low * 100, laws.high * 100]
    if (this.dry) {
      const [low, high] = this.reach
      if (Number.isFinite(low)) this.x = [Math.min(this.x[0], low - 0.3), Math.max(this.x[1], high + 0.3)]
    }
    this.x = ends(...this.x)
    const top = Math.max(20, Math.min(highest * 1.2, limit * 1.25))
    if (Math.abs(top - this.y[1]) > 0.2 * this.y[1] || top > this.y[1]) this.y = [0, top]
  }

  draw () {
    this.build()
    this.dirty = false
    const u = this.plot
    if (!u) return
    const x = this.part?.x ?? this.x; const y = this.part?.y ?? this.y; const key = [...x, ...y].join()
    if (key === this.key && u === this.of) { u.redraw(false, false); return }
    this.key = key; this.of = u
    u.batch(() => { u.setScale('x', { min: x[0], max: x[1] }); u.setScale('y', { min: y[0], max: y[1] }) })
  }

  over (u) {
    const { ctx, bbox } = u; const px = devicePixelRatio; const X = v => u.valToPos(v, 'x', true); const Y = v => u.valToPos(v, 'y', true)
    ctx.save()
    ctx.strokeStyle = token('--rule'); ctx.lineWidth = px; ctx.strokeRect(bbox.left, bbox.top, bbox.width, bbox.height)
    ctx.beginPath(); ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height); ctx.clip()
    const ends = []
    for (const law of this.laws?.lines ?? []) {
      const xs = []; const ys = []
      law.length.forEach((l, i) => { if (law.tension[i] > 0.3 && law.tension[i] < (this.part?.y ?? this.y)[1]) { xs.push(X(l * 100)); ys.push(Y(law.tension[i])) } })
      stroke(ctx, xs, ys, { colour: token(this.old ? '--ink-3' : '--q-pressure'), width: 1, opacity: 0.75 })
      if (xs.length) ends.push([xs.at(-1), ys.at(-1), law.words])
    }
    if (this.dry && !this.live) {
      const xs = this.dry.length.map(v => v === null ? NaN : X(v)); const ys = this.dry.tension.map(v => v === null ? NaN : Y(v))
      stroke(ctx, xs, ys, { colour: token(this.old ? '--ink-2' : '--q-tension'), width: 1.5, dash: [4, 3] })
    }
    if (this.live) this.live_(ctx, X, Y)
    this.measured(ctx, X, Y)
    ctx.restore()
    ctx.save()
    ctx.font = `${size(11) * px}px ${token('--font')}`; ctx.textBaseline = 'middle'; ctx.textAlign = 'left'; ctx.fillStyle = token(this.old ? '--ink-3' : '--q-pressure')
    const { left, top, width, height } = bbox
    let taken = Infinity // where the label of the next line to the right begins
    for (const [i, [x, y, text]] of [...ends.entries()].sort(([, a], [, b]) => b[0] - a[0])) {
      if (this.part && !(x >= left && x <= left + width && y >= top && y <= top + height)) continue
      const said = i === ends.length - 1 ? text.replace(' ', TS) : text.split(' ')[0]
      const wide = ctx.measureText(said).width; const beside = x + 4 * px + wide + 3 * px < taken || y > top + 2 * size(11) * px
      ctx.fillText(said, beside ? x + 4 * px : x - 5 * px - wide, y)
      taken = beside ? x : x - 5 * px - wide
    }
    const rest = this.rest
    if (rest && X(rest) >= bbox.left && X(rest) <= bbox.left + bbox.width) { ctx.fillStyle = token('--ink-3'); ctx.textAlign = 'center'; ctx.fillText('L\u2080', X(rest), bbox.top + bbox.height + 27 * px) }
    ctx.restore()
  }

  // Own data: dashed as the second recording of a quantity, or the points of a map, with their name at the highest one.
  measured (ctx, X, Y) {
    const own = this.own?.loop()
    if (!own) return
    const xs = own.x.map(X); const ys = own.y.map(Y)
    if (own.points) xs.forEach((x, i) => dot(ctx, 'tension', x, ys[i], 4, { hollow: true })); else stroke(ctx, xs, ys, { colour: token('--q-tension'), width: 1.75, dash: this.live ? [6, 3] : [] })
    const top = own.y.reduce((a, v, i) => v > (own.y[a] ?? -Infinity) ? i : a, 0); const px = devicePixelRatio
    ctx.font = `600 ${size(11) * px}px ${token('--font')}`; ctx.textAlign = 'center'; ctx.textBaseline = 'alphabetic'; ctx.fillStyle = token('--q-tension'); ctx.fillText('measured', xs[top], ys[top] - 6 * px)
  }

  /** What is drawn, as the document of a chart. */
  document () {
    const b = this.buffer; const lines = (this.laws?.lines ?? []).map(l => {
      const some = l.tension.map((v, i) => i).filter(i => l.tension[i] > 0.3 && l.tension[i] <= this.y[1])
      return { x: some.map(i => l.length[i] * 100), y: some.map(i => l.tension[i]), label: l.words, quantity: 'pressure', width: 1, opacity: 0.75 }
    })
    if (this.dry && !this.live) lines.push({ x: this.dry.length, y: this.dry.tension, quantity: 'tension', dash: 'B', width: 1.5 })
    if (this.live && b.n) {
      const end = this.end ?? b.end; const [i, j] = b.between(Math.max(end - (this.period || 6), b.t[0]), end); const step = Math.max(1, Math.floor((j - i) / 2000)); const x = []; const y = []
      for (let k = i; k < j; k += step) { x.push(b.c.length[k]); y.push(b.c.tension[k]) }
      lines.push({ x, y, quantity: 'tension', width: 2.25, fill: Boolean(this.period) })
    }
    const own = this.own?.loop()
    return { name: 'Tension over length', x: { label: 'Length', unit: 'cm', quantity: 'length', low: this.x[0], high: this.x[1] }, y: { label: 'Tension', unit: 'N', quantity: 'tension', low: this.y[0], high: this.y[1] }, lines: own ? [...lines, { x: own.x, y: own.y.map(v => Number.isFinite(v) ? v : null), label: 'measured', quantity: 'tension', dash: 'B', width: 1.75, points: own.points, line: !own.points }] : lines, marks: [] }
  }

  live_ (ctx, X, Y) {
    const b = this.buffer
    if (!b.n) return
    const end = this.end ?? b.end; const span = this.period || 6
    const part = (t0, t1) => {
      const [i, j] = b.between(Math.max(t0, b.t[0]), t1); const n = j - i; const step = Math.max(1, Math.floor(n / 900)); const xs = []; const ys = []
      for (let k = i; k < j; k += step) { xs.push(X(b.c.length[k])); ys.push(Y(b.c.tension[k])) }
      return [xs, ys]
    }
    const colour = token(this.old ? '--ink-2' : '--q-tension')
    if (this.period && end - this.from > this.period) {
      const whole = this.from + Math.floor((end - this.from) / this.period) * this.period
      const [xs, ys] = part(whole - this.period, whole)
      stroke(ctx, xs, ys, { colour, width: 1, opacity: 0.6, fill: token(this.old ? '--tint' : '--q-tension-fill'), close: true })
      arrows(ctx, xs, ys, colour)
      if (this.work) this.say(ctx, colour)
    }
    const [xs, ys] = part(end - span, end)
    stroke(ctx, xs, ys, { colour, width: 2.5 })
    const at = this.cursor === null ? b.at(end) : b.at(this.cursor)
    dot(ctx, 'tension', X(b.c.length[at]), Y(b.c.tension[at]), 6)
  }

  // The work, in the corner of short lengths and high tensions, where no muscle is: a thin loop would vanish below its number.
  say (ctx, colour) {
    const px = devicePixelRatio; const { left, top } = this.plot.bbox; const x = left + 8 * px
    ctx.textAlign = 'left'; ctx.textBaseline = 'alphabetic'; ctx.fillStyle = colour; ctx.font = `600 ${size(17) * px}px ${token('--font')}`
    ctx.fillText(`${fmt(this.work, 2)}${TS}J`, x, top + size(20) * px); ctx.fillStyle = token('--ink-2'); ctx.font = `${size(11) * px}px ${token('--font')}`
    ctx.fillText(this.words, x, top + size(35) * px)
  }
}
