// The flow of energy as streams whose width is their energy: air is blue, work is orange, every loss grey.
import { magnify } from './view.js'
import { TS, escape, fmt, say, size } from './words.js'

const WORK = ['shaft_work']; const STORED = ['gas', 'muscle', 'tendon']
const places = v => Math.max(0, Math.min(5, 2 - Math.floor(Math.log10(Math.abs(v) || 1))))
const joules = v => `${fmt(v, Math.min(places(v), 4))}${TS}J`

const ribbon = (xa, ya, xb, yb, h, look) => { const m = (xa + xb) / 2; return `<path d="M${xa} ${ya}C${m} ${ya} ${m} ${yb} ${xb} ${yb}V${yb + h}C${m} ${yb + h} ${m} ${ya + h} ${xa} ${ya + h}z" ${look}/>` }
const node = (x, y, h, c = 'var(--ink)') => `<rect x="${x}" y="${y}" width="5" height="${Math.max(1.5, h)}" fill="${c}"/>`
const look = (key, hub) => {
  if (key === 'supply' || key === 'machines' || key === 'walls') return 'fill="var(--q-pressure)" opacity=".6"'
  if (WORK.includes(key) || key === hub) return 'fill="var(--q-tension)" opacity=".7"'
  if (STORED.includes(key)) return 'fill="var(--panel)" stroke="var(--edge)" stroke-dasharray="3 2"'
  return 'fill="var(--hatch)"'
}
const colour = (key, hub) => key === 'supply' ? 'var(--q-pressure)' : WORK.includes(key) || key === hub ? 'var(--q-tension)' : 'var(--ink)'
const sentence = words => words[0].toUpperCase() + words.slice(1)

/** Places at least `gap` apart, as near to the wished ones as can be, from `low` on. */
function spread (wished, gap, low, high) {
  const out = [...wished]
  for (let i = 0; i < out.length; i++) out[i] = Math.max(out[i], i ? out[i - 1] + gap : low)
  for (let i = out.length - 1, most = high; i >= 0; i--, most = out[i + 1] - gap) out[i] = Math.min(out[i], most)
  return out
}

export function sankey (place, d, w) {
  const narrow = w < 560; const H = narrow ? 420 : 300; const open = place.querySelector('details')?.open
  const x = narrow ? [0, Math.round(w * 0.24), w - 148] : [6, Math.round(Math.min(250, w * 0.24)), w - 226]
  const whole = d.gas.into.reduce((s, a) => s + a.value, 0)
  let svg = ''; let note = ''
  const rows = d.parts.map(p => `<tr data-part="${escape(p.side)}.${escape(p.name)}" data-value="${p.value}"><td>${p.side}</td><td>${escape(p.name)}</td><td class="num">${fmt(p.value ?? NaN, 4)}</td><td class="num">${p.share === null ? '' : fmt(100 * p.share, 2)}</td><td class="faint">${escape(p.origin)}</td><td class="faint">${escape(p.meaning)}</td></tr>`).join('')
  const below = more => `<p class="say">${d.say.map(s => escape(say(s))).join(' ')}${more}</p><details class="values"><summary>Table of values</summary><div class="scroll"><table><thead><tr><th></th><th>part</th><th class="num">J</th><th class="num">%</th><th>from</th><th></th></tr></thead><tbody>${rows}</tbody></table></div></details>`
  if (!(whole > 0)) {
    place.innerHTML = (d.supply === null ? '' : '<p class="say">No air was drawn and no work was done in this stretch.</p>') + below('')
    place.querySelector('details').open = true
    return
  }
  const least = d.least * whole
  const through = d.gas.out.find(s => s.key === d.hub)
  const big = list => list.filter(s => s.value >= least).sort((a, b) => b.value - a.value)
  const way = big(d.gas.out.filter(s => d.way.includes(s.key))); const rest = big(d.gas.out.filter(s => !d.way.includes(s.key) && s !== through))
  const extra = big(d.muscle.into.filter(s => s.key !== d.hub)); const work = big(d.muscle.out.filter(s => s.key !== d.hub))
  const inside = (through?.value ?? 0)
  const ends = [...work, ...rest]
  const lost = way.reduce((s, a) => s + a.value, 0); const small = [...d.gas.into, ...d.gas.out, ...d.muscle.out].filter(s => s.value < least)
  const gap = 16; const k = Math.max(1, H - 44 - gap * Math.max(ends.length - 1, way.length + 1)) / Math.max(whole, lost + ends.reduce((s, a) => s + a.value, 0) * (narrow ? 1 : 0.001))
  const y0 = narrow ? 40 : 22
  // sources at the left: the supply first
  let y = y0
  const label = (X, Y, words, value, c = 'var(--ink)', share = true) => `<text x="${X}" y="${Y.toFixed(1)}" style="font-size:12px"><tspan style="font-weight:600;fill:${c}">${escape(say(words))}</tspan><tspan x="${X}" dy="${size(15)}" style="fill:var(--ink-2)">${joules(value)}${share && d.supply > 0 ? ` \u00b7 ${fmt(value / d.supply * 100, value / d.supply < 0.0995 ? 1 : 0)}${TS}%` : ''}</tspan></text>`
  for (const s of big(d.gas.into)) {
    const h = s.value * k
    svg += node(x[0], y, h, colour(s.key, d.hub))
    y += h
  }
  // in the volumes: all that was not lost on the way
  const middle = (whole - lost) * k; const way0 = y0 + middle
  svg += ribbon(x[0] + 5, y0, x[1], y0, middle, 'fill="var(--q-pressure)" opacity=".55"')
  svg += node(x[1], y0, middle, 'var(--q-pressure)')
  let left = way0; let yw = way0 + 26
  const waysAt = []
  for (const s of way) {
    const h = s.value * k
    svg += ribbon(x[0] + 5, left, x[1], yw, h, look(s.key, d.hub)) + node(x[1], yw, h)
    waysAt.push([s, yw, h]); left += h; yw += Math.max(h, 20) + 14
  }
  // from there to where it ended: first the work of the muscle, then what was lost
  left = y0
  const sources = extra.reduce((s, a) => s + a.value, 0)
  let end = y0; const at = []
  const scale = inside > 0 && inside + sources > 0 ? (inside) / (inside + sources) : 1
  for (const s of ends) {
    const h = s.value * k; const from = work.includes(s) ? h * scale : h
    const shape = look(s.key, d.hub)
    if (inside > 0 || !work.includes(s)) svg += ribbon(x[1] + 5, left, x[2], end, from, shape)
    left += inside > 0 || !work.includes(s) ? from : 0
    svg += node(x[2], end, h, colour(s.key, d.hub))
    at.push([s, end, h]); end += h + gap
  }
  const bottom = Math.max(end, yw, y) + 8
  const spots = spread(at.map(([, Y, h]) => Y + h / 2 - 3), size(32), size(12), Math.max(bottom, size(12 + 32 * at.length)))
  at.forEach(([s, Y, h], i) => {
    const X = x[2] + 14
    if (Math.abs(spots[i] - (Y + h / 2 - 3)) > 8) svg += `<path d="M${x[2] + 5} ${Y + h / 2}L${X - 2} ${spots[i] - 1}" stroke="var(--ink-3)" stroke-width=".75"/>`
    svg += label(X, spots[i], sentence(s.words), s.value, colour(s.key, d.hub))
  })
  const first = d.gas.into.find(s => s.key === 'supply') ?? d.gas.into[0]
  svg += narrow
    ? label(0, 12, sentence(first.words), first.value, 'var(--q-pressure)', false)
    : label(x[0] + 14, y0 + whole * k / 2 - 4, sentence(first.words), first.value, 'var(--ink)', false)
  if (!narrow || way.length) svg += label(narrow ? x[1] + 8 : x[1] + 14, narrow ? y0 + Math.min(middle / 2, 90) : y0 + middle / 2 - 4, narrow ? 'In the volumes' : 'Into tubes and muscle', whole - lost, 'var(--ink)', false)
  const wspots = spread(waysAt.map(([, Y, h]) => Y + h / 2 - 3), size(32), 0, 1e6)
  waysAt.forEach(([s, , ], i) => { svg += label(x[1] + 14, wspots[i], narrow ? sentence(s.words) : `${sentence(s.words)}, throttling while filling`, s.value) })
  if (extra.length) note += ` The muscle was also given ${extra.map(s => `${joules(s.value)} (${escape(s.words)})`).join(', ')}.`
  const tall = Math.max(bottom, (spots.at(-1) ?? 0) + size(26), (wspots.at(-1) ?? 0) + size(26))
  if (small.length) note += ` Below ${fmt(100 * d.least, 2)}${TS}%, not drawn: ${[...new Set(small.map(s => escape(s.words)))].join(', ')}.`
  const summary = `Flow of energy: ${[...d.gas.into, ...ends, ...way].map(s => `${s.words} ${fmt(s.value, 2)} J`).join(', ')}`
  place.innerHTML = `<div class="flow-field" tabindex="0" role="img" aria-label="${escape(summary)}"><svg width="${w}" height="${tall.toFixed(0)}" viewBox="0 0 ${w} ${tall.toFixed(0)}" aria-hidden="true">${svg}</svg></div>${below(note)}`
  magnify(place.firstChild)
  place.querySelector('details').open = Boolean(open)
}
