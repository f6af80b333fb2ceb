// Own measured data over the simulated run: in the strips and in the loop, with what is left between them.
import { events, lab, link } from './lab.js'
import { TS, escape, fmt, say } from './words.js'

const $ = s => document.querySelector(s)
const SHOWN = { tension: ['N', 1], pressure: ['bar', 3], length: ['cm', 3] }
const least = list => list.reduce((a, v) => v !== null && v < a ? v : a, Infinity); const most = list => list.reduce((a, v) => v !== null && v > a ? v : a, -Infinity)

/** The data of one file, in the units of the page. */
export class Measured {
  /** @param strips, whose samples or dry run it is compared with @param changed is called when something is to be drawn anew */
  constructor (strips, changed) {
    this.strips = strips; this.changed = changed; this.data = null; this.shift = 0; this.moved = false; this.names = null; this.said = ''; this.busy = ''; this.shown = ''
    const place = $('#own')
    place.innerHTML = '<h2>Own data <span class="faint plain">laid over the simulation</span></h2><div class="own-file"><div class="field s"><select aria-label="Own data"><option value="">none</option></select></div><button class="btn s" type="button">Choose file</button><input type="file" hidden></div><div class="own-said" role="status"></div>'
    const [select, button, input] = ['select', 'button', 'input'].map(s => place.querySelector(s))
    this.select = select
    button.onclick = () => input.click()
    input.onchange = () => { if (input.files[0]) this.upload(input.files[0]); input.value = '' }
    for (const name of ['pointerdown', 'focus']) select.addEventListener(name, () => this.list())
    select.onchange = () => select.value ? this.load(select.value) : this.clear()
    const main = $('main.bench')
    main.addEventListener('dragover', e => { if ([...e.dataTransfer.types].includes('Files')) { e.preventDefault(); main.classList.add('dropping') } })
    main.addEventListener('dragleave', e => { if (e.target === main || !main.contains(e.relatedTarget)) main.classList.remove('dropping') })
    main.addEventListener('drop', e => { if (e.dataTransfer.files[0]) { e.preventDefault(); main.classList.remove('dropping'); this.upload(e.dataTransfer.files[0]) } })
    const asked = new URLSearchParams(location.search)
    const name = asked.get('measured')
    let begun = false
    const begin = () => { if (!begun && lab.parts.setup && (begun = true)) this.load(name, asked.get('part') ?? '', asked.get('shift')) }
    if (name) events.addEventListener('part', begin)
    this.show()
  }

  async list () {
    if (this.names) return
    const answer = await fetch('/measured').catch(() => null)
    if (!answer?.ok) return
    this.names = (await answer.json()).names
    setTimeout(() => { this.names = null }, 5000)
    const now = this.data?.name ?? ''
    this.select.innerHTML = `<option value="">none</option>${[...new Set([now, ...this.names])].filter(Boolean).map(n => `<option value="${escape(n)}"${n === now ? ' selected' : ''}>${escape(n)}</option>`).join('')}`
  }

  upload (file) { return this.ask(file.name, '', { method: 'POST', body: file }) }
  load (name, part = '', shift = null) { return this.ask(name, part, {}, shift) }
  async ask (name, part, how, shift = null) {
    this.busy = name; this.said = ''; this.show()
    const answer = await fetch(`/measured?${new URLSearchParams({ name, part })}`, how).catch(() => null)
    this.busy = ''
    if (!answer?.ok) { this.said = answer ? await answer.text() : 'The file did not reach the server.'; this.show(); return }
    this.take(await answer.json(), shift)
  }

  take (d, shift) {
    const of = (name, factor) => d[name] ? Float64Array.from(d[name], v => v === null ? NaN : v * factor) : null
    const units = lab.parts.setup.units
    this.data = { ...d, t: d.time && Float64Array.from(d.time), pressure: of('pressure', units.pressure.factor), tension: of('tension', 1), length: of('length', units.length.factor), law: of('law', 1) }
    this.ends = Object.fromEntries(Object.keys(SHOWN).map(q => { const known = this.data[q] && [...this.data[q]].filter(v => v === v); return [q, known?.length ? [least(known), most(known)] : null] }))
    this.moved = shift !== null && Number.isFinite(+shift); this.shift = this.moved ? +shift : d.shift ?? 0
    this.names = null; this.list()
    link({ measured: d.name, part: d.part || '' })
    this.show(); this.changed()
  }

  clear () { this.data = null; this.said = ''; this.moved = false; link({ measured: '', part: '', shift: '' }); this.show(); this.changed() }
  /** After another dry run the data are put on its time again, until a person has moved them. */
  again () { if (this.data && !this.moved && !this.busy) this.load(this.data.name, this.data.part) }

  /** Lowest and highest value of a quantity. */
  extremes (q) { return this.data ? this.ends[q] ?? null : null }
  /** First and last sample between two times of the page. */
  between (a, b) {
    const t = this.data.t; const at = time => { let low = 0; let high = t.length; while (low < high) { const m = (low + high) >> 1; if (t[m] < time) low = m + 1; else high = m } return low }
    return [Math.max(0, at(a - this.shift) - 1), Math.min(t.length, at(b - this.shift) + 1)]
  }

  /** Measured less simulated at a sample; NaN where there is no simulated one. */
  left (q, k) {
    const { buffer, source } = this.strips; const time = this.data.t[k] + this.shift; const v = this.data[q][k]
    if (source) return source[q] ? v - this.expected(q, time) : NaN
    if (!buffer.n || time < buffer.t[0] - 1e-9 || time > buffer.end + 1e-9) return NaN
    const i = buffer.at(time); const j = Math.min(i + 1, buffer.n - 1); const c = buffer.c[q]; const wide = buffer.t[j] - buffer.t[i]
    return v - (wide > 0 ? c[i] + (c[j] - c[i]) * Math.min(1, Math.max(0, (time - buffer.t[i]) / wide)) : c[i])
  }

  expected (q, time) {
    const s = this.strips.source; let low = 0; let high = s.time.length - 1
    if (time < s.time[0] || time > s.time[high]) return NaN
    while (high - low > 1) { const m = (low + high) >> 1; if (s.time[m] <= time) low = m; else high = m }
    const a = s[q][low]; const b = s[q][high]
    return a === null || b === null ? NaN : a + (b - a) * (time - s.time[low]) / (s.time[high] - s.time[low] || 1)
  }

  /** Root mean square of what is left of a quantity, and how many samples were compared. */
  rms (q) {
    const d = this.data; let sum = 0; let n = 0
    if (!d?.[q]) return { rms: NaN, n: 0 }
    if (!d.t) { if (q === 'tension' && d.law) d.tension.forEach((v, i) => { const r = v - d.law[i]; if (r === r) { sum += r * r; n++ } }) } else {
      const reach = this.strips.source ? [this.strips.source.time[0], this.strips.source.time.at(-1)] : this.strips.buffer.n ? [this.strips.buffer.t[0], this.strips.buffer.end] : null
      if (reach) { const [i, j] = this.between(...reach); for (let k = i; k < j; k++) { const r = this.left(q, k); if (r === r) { sum += r * r; n++ } } }
    }
    return { rms: Math.sqrt(sum / n), n }
  }

  /** The numbers, ten times a second. */
  numbers () {
    if (!this.data) return
    const rows = Object.keys(SHOWN).map(q => [q, this.rms(q)]).filter(([, r]) => r.n > 1).map(([q, r]) => {
      const [low, high] = this.ends[q]; const range = high - low; const [unit, places] = SHOWN[q]
      return `<dt class="${{ tension: 'F', pressure: 'P', length: 'L' }[q]}">${q[0].toUpperCase()}${q.slice(1)}, rms</dt><dd data-rms="${q}">${fmt(r.rms, places)}${TS}${unit}<span class="faint"> \u00b7 ${fmt(100 * r.rms / range, 1)}${TS}% of range</span></dd>`
    })
    this.last = this.rms('tension')
    const { n } = this.last
    const words = rows.length ? `<dl class="meas">${rows.join('')}</dl>` : ''
    const what = this.data.t ? this.strips.source ? 'less the dry run' : 'less the simulation' : 'less the law, without friction'
    const text = `${words}<p class="small faint">${n > 1 ? `Measured ${what}, ${fmt(n, 0)} samples.` : 'Nothing to compare yet: the times do not meet.'}</p>`
    const place = $('#own .own-numbers')
    if (place && text !== this.shown) { this.shown = text; place.innerHTML = text }
  }

  show () {
    const place = $('#own .own-said'); const d = this.data
    if (this.busy) { place.innerHTML = `<p class="small dim">Reading ${escape(this.busy)}</p>`; return }
    this.shown = ''
    const parts = d?.parts.length ? `<label class="own-row"><span>${d.option === 'sheet' ? 'Sheet' : 'Topic'}</span><span class="field s"><select data-part>${(d.option === 'topic' ? [''] : []).concat(d.parts).map(p => `<option value="${escape(p)}"${p === d.part ? ' selected' : ''}>${escape(p || 'all topics')}</option>`).join('')}</select></span></label>` : ''
    const shift = d?.t ? `<label class="own-row"><span>Begins at</span><span class="field s"><input data-shift inputmode="decimal" size="7" value="${fmt(d.t[0] + this.shift, 3).replace('\u2212', '-')}"><span class="u">s</span></span></label>` : ''
    place.innerHTML = `${this.said ? `<p class="small err">${escape(say(this.said))}</p>` : ''}${d ? `${parts}${shift}<div class="own-numbers"></div>` : this.said ? '' : '<p class="small faint">Drop a file of measurements anywhere on this page, or choose one, or a recording.</p>'}`
    const part = place.querySelector('[data-part]'); const field = place.querySelector('[data-shift]')
    if (part) part.onchange = () => this.load(d.name, part.value)
    if (field) field.onchange = () => { const v = parseFloat(field.value.replace('\u2212', '-')); if (Number.isFinite(v)) { this.shift = v - d.t[0]; this.moved = true; link({ shift: +this.shift.toPrecision(6) }) } this.show(); this.changed() }
    this.numbers()
  }

  /** The loop: the last full cycle, or the points of a map. */
  loop () {
    const d = this.data
    if (!d?.length || !d.tension) return null
    const [i, j] = d.cycle ?? [0, d.tension.length - 1]; const x = []; const y = []
    for (let k = i; k <= j; k++) { x.push(d.length[k]); y.push(d.tension[k]) }
    return { x, y, points: !d.t }
  }
}
