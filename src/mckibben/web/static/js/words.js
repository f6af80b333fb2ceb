// Numbers and units as a person reads them: thin space that never breaks, minus U+2212, groups of three.
export const TS = '\u2009\u2060'
export const words = {
  cannot: 'This page cannot reach the server: use the button on the machine.'
}
const UNITS = /(\d) (bar\/s|bar|N\/cm|N|cm\/s|cm|mm|m|L\/min|%|ms|us|s|kHz|Hz|J|W|deg|MB|kB|B|L0\/s|L0)(?![\w/])/g
/** A sentence with its numbers and units as they are set: `5 bar` with a thin space, a minus that is one. */
export const say = text => String(text).replace(/\+-/g, '\u00b1').replace(/(^|[\s(])-(?=\d)/g, '$1\u2212').replace(UNITS, `$1${TS}$2`)
/** A number with a fixed count of places, `-0.00` never. */
export function fmt (v, places = 2) {
  if (!Number.isFinite(v)) return '\u2013'
  const text = Math.abs(v).toFixed(places)
  const grouped = text.replace(/^(\d+)/, d => d.length > 3 ? d.replace(/\B(?=(\d{3})+$)/g, '\u2009') : d)
  return (v < 0 && +text !== 0 ? '\u2212' : '') + grouped
}
/** How many places a number such as the distance of two ticks has: 0.25 has two. */
export function digits (step) {
  let d = 0
  while (d < 6 && Math.abs(step * 10 ** d - Math.round(step * 10 ** d)) > 1e-6 * Math.abs(step) * 10 ** d) d++
  return d
}
/** Numbers from one to another, evenly apart: never more than `most`, none where the three say no finite row. */
export function row (first, step, last, most = 400) {
  const n = Math.floor((last - first) / step + 1e-9) + 1
  return step > 0 && Number.isFinite(n) ? Array.from({ length: Math.max(0, Math.min(n, most)) }, (_, i) => Math.min(first + i * step, last)) : []
}
/** Ends of an axis between which numbers can be told apart, so that whoever steps from one to the other gets there. */
export function ends (low, high) {
  if (!Number.isFinite(low) || !Number.isFinite(high)) return [0, 1]
  const least = 1e-9 * Math.max(Math.abs(low), Math.abs(high))
  return high - low > least ? [low, high] : [low - (least || 0.5), high + (least || 0.5)]
}
export const clamp = (v, a, b) => Math.max(a, Math.min(b, v))
export const escape = text => String(text).replace(/[&<>"']/g, c => `&#${c.charCodeAt(0)};`)
/** What a quantity looks like, on every page. */
export const Q = {
  pressure: { name: 'Pressure', sign: 'P', unit: 'bar', places: 2, limit: 2, mark: 'c', dash: [] },
  tension: { name: 'Tension', sign: 'F', unit: 'N', places: 1, limit: 0, mark: 't', dash: [14, 3] },
  length: { name: 'Length', sign: 'L', unit: 'cm', places: 2, limit: 1, mark: 's', dash: [7, 4] },
  flow: { name: 'Flow', sign: 'q', unit: 'L/min', places: 1, mark: 'd', dash: [2, 3] },
  valve: { name: 'Valve', sign: 'u', unit: '%', places: 0, mark: 'v', dash: [9, 3, 2, 3] }
}
/** What a measured tension leaves over a simulated one: ink, as all that is derived. */
export const RESIDUAL = { name: 'Residual', sign: 'F', unit: 'N', places: 1, limit: 0, mark: 't', dash: [] }
const known = new Map(); let style = null
/** The value of a custom property, such as a colour, in the present theme. */
export function token (name) {
  let value = known.get(name)
  if (value === undefined) {
    style ??= getComputedStyle(document.documentElement)
    value = style.getPropertyValue(name).trim()
    known.set(name, value)
  }
  return value
}
/** Sizes of text and of what holds it, and weights of strokes, which a projector makes larger. */
export const projected = () => document.documentElement.dataset.projector === '1'
export const size = px => projected() ? 1.45 * px : px
export const weight = px => projected() ? 1.7 * px : px
/** The theme is another one. */
export const forget = () => known.clear()
export const colour = q => token(Q[q] ? `--q-${q}` : '--ink')
/** The path of a quantity's marker around a place, for an SVG or a Path2D. */
export function mark (q, x, y, r = 4) {
  const m = Q[q]?.mark ?? 'c'
  if (m === 't') return `M${x} ${y - r * 1.15}l${r * 1.1} ${r * 2}h${-2.2 * r}z`
  if (m === 's') return `M${x - r * 0.9} ${y - r * 0.9}h${r * 1.8}v${r * 1.8}h${-r * 1.8}z`
  if (m === 'd') return `M${x} ${y - r * 1.25}l${r * 1.25} ${r * 1.25}l${-r * 1.25} ${r * 1.25}l${-r * 1.25} ${-r * 1.25}z`
  if (m === 'v') return `M${x} ${y + r * 1.15}l${r * 1.1} ${-r * 2}h${-2.2 * r}z`
  return `M${x - r} ${y}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0z`
}
/** The sign of a quantity: a piece of its line with its marker. */
export function keySign (q, w = 26) {
  const c = `var(--q-${q})`
  return `<svg class="key" width="${w}" height="12" viewBox="0 0 ${w} 12" aria-hidden="true"><path d="M0 6H${w}" stroke="${c}" stroke-width="${q === 'tension' ? 2.5 : 2}" stroke-dasharray="${Q[q].dash.join(' ')}"/><path d="${mark(q, w / 2, 6, 3.4)}" fill="${c}" stroke="var(--panel)" stroke-width="1.2"/></svg>`
}
