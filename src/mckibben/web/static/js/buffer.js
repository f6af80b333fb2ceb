// The newest samples of the stream as columns that uPlot can take; memory is bounded.
export const NAMES = ['pressure', 'tension', 'length', 'flow', 'valve', 'set_pressure', 'set_length']
const SIZE = 150000

export class Buffer {
  constructor () {
    this.t = new Float64Array(SIZE)
    this.c = Object.fromEntries(NAMES.map(n => [n, new Float32Array(SIZE)]))
    this.clear('', 0, 1e-3)
  }

  /** Forget everything; an epoch is one of a server, and another server counts its own. */
  clear (server, epoch, period) { this.server = server; this.epoch = epoch; this.period = period; this.first = 0; this.n = 0; this.high = {}; this.low = {} }

  /** Take a frame, in displayed units. */
  add ({ server, epoch, first, n, values }, factors, period) {
    if (server !== this.server || epoch !== this.epoch || first > this.first + this.n || first + n < this.first) { this.clear(server, epoch, period); this.first = first }
    let skip = this.first + this.n - first
    if (skip >= n) return
    if (n - skip > SIZE / 2) skip = n - SIZE / 2
    if (this.n + n - skip > SIZE) this.drop(Math.max(SIZE / 2, n - skip))
    const at = this.n
    for (let j = skip; j < n; j++) this.t[at + j - skip] = (first + j) * period
    NAMES.forEach((name, i) => {
      const column = this.c[name]; const from = values[i]; const factor = factors[name.replace('set_', '')] ?? 1
      let low = this.low[name] ?? Infinity; let high = this.high[name] ?? -Infinity
      for (let j = skip; j < n; j++) {
        const v = from[j] * factor
        column[at + j - skip] = v
        if (v < low) low = v
        if (v > high) high = v
      }
      this.low[name] = low; this.high[name] = high
    })
    this.n += n - skip
  }

  drop (count) {
    const by = Math.min(count, this.n)
    this.t.copyWithin(0, by, this.n)
    for (const name of NAMES) this.c[name].copyWithin(0, by, this.n)
    this.first += by; this.n -= by
  }

  get end () { return this.n ? this.t[this.n - 1] : 0 }
  /** The sample at or before a time. */
  at (time) {
    let low = 0; let high = this.n - 1
    while (low < high) { const m = (low + high + 1) >> 1; if (this.t[m] <= time + 1e-9) low = m; else high = m - 1 }
    return low
  }

  /** The columns between two times, one sample more at either side. */
  between (a, b) {
    const i = Math.max(0, this.at(a) - 1); const j = Math.min(this.n, this.at(b) + 2)
    return [i, j]
  }

  latest (name) { return this.n ? this.c[name][this.n - 1] : NaN }
}
