// The comparison: muscles to one scale, and surfaces of tension over length and drive.
import { events } from './lab.js'
import { drawMuscle, fitting, sharp, braid, PX } from './muscle.js'
import { nice } from './plot.js'
import { fromDrawing, inDrawing, magnify } from './view.js'
import { TS, clamp, fmt, row, token } from './words.js'

const H = 74
function drawings () {
  const all = [...document.querySelectorAll('canvas.drawn[data-muscle]')]
  if (!all.length) return
  const specs = all.map(c => JSON.parse(c.dataset.muscle))
  const room = Math.min(...all.map(c => c.parentElement.clientWidth - 16))
  const longest = Math.max(...specs.map(s => s.rest_length * 100))
  const widest = Math.max(...specs.map(s => s.fibre ? spindle(s, s.shortest) : braid(s, s.shortest * 100).diameter))
  const k = Math.min((room - 6) / (longest + 1.8), 34 / widest)
  all.forEach((c, i) => one(c, specs[i], k, room))
  for (const e of document.querySelectorAll('.scale')) e.textContent = `1${TS}:${TS}${fmt(PX / k, 1)} of life`
}
const spindle = (s, length) => 2 * Math.sqrt(s.area * 1e4 / Math.PI * s.rest_length / length)
function one (canvas, s, k, room) {
  const g = sharp(canvas, Math.max(40, room), H)
  for (const [length, y, pressure] of [[s.rest_length, 20, 0], [s.shortest, 52, s.full]]) {
    if (s.fibre) { fibre(g, length * 100 * k, spindle(s, length) * k / 2, y); continue }
    const x = 2 + 0.9 * k // a fitting is 0.9 cm long
    fitting(g, x, y, k, -1)
    drawMuscle(g, s, length * 100, k, x, y, { pressure, threads: 9, thin: 0.6 })
    fitting(g, x + length * 100 * k, y, k, 1)
  }
}
function fibre (g, w, r, y) {
  r = Math.max(r, 2)
  g.save()
  g.lineWidth = 1; g.strokeStyle = token('--ink-2'); g.fillStyle = token('--sunken')
  g.beginPath()
  for (const side of [-1, 1]) {
    for (let i = 0; i <= 40; i++) { const t = (side < 0 ? i : 40 - i) / 40; const R = 1.5 + (r - 1.5) * Math.sin(Math.PI * t) ** 1.4; g.lineTo(6 + w * t, y + side * R) }
  }
  g.closePath(); g.fill(); g.stroke()
  g.lineWidth = 0.6; g.strokeStyle = token('--ink-3')
  for (let i = -2; i <= 2; i++) { g.beginPath(); g.moveTo(8, y); g.quadraticCurveTo(6 + w / 2, y + i * r * 0.6, w + 4, y); g.stroke() }
  g.restore()
}

const points = l => 'M' + l.map(p => `${p[0].toFixed(1)} ${p[1].toFixed(1)}`).join('L')
function surface (place) {
  const s = JSON.parse(place.dataset.surface)
  const W = place.clientWidth; const h = place.clientHeight
  if (W < 60) return
  const back = -Math.min(46, W * 0.2); const up = -58; const x0 = 34 - back; const y0 = h - 26
  const sx = (W - x0 - 24) / (s.scale.high - s.scale.low); const { step, places } = nice(0, s.scale.top, 3); const top = Math.max(step, Math.ceil(s.scale.top / step) * step)
  const sz = (y0 + up - 14) / top; const full = s.drives.at(-1)
  const at = (x, d, f) => [x0 + (x - s.scale.low) * sx + back * d / full, y0 + up * d / full - f * sz]
  const blue = s.of === 'pressure' ? 'var(--q-pressure)' : 'var(--ink)'
  const { low, high } = s.scale
  let o = `<path d="${points([at(low, 0, 0), at(high, 0, 0), at(high, full, 0), at(low, full, 0)])}z" fill="var(--sunken)" stroke="var(--rule)"/>`
  for (const x of row(Math.ceil(low * 10) / 10, 0.1, high - 1e-9, 60)) {
    o += `<path d="${points([at(x, 0, 0), at(x, full, 0)])}" stroke="var(--rule)"/>`
    if (Math.round(x * 10) % 2 === 0) { const a = at(x, 0, 0); o += `<text class="tick" x="${a[0]}" y="${a[1] + 13}" text-anchor="middle">${fmt(x, 1)}</text>` }
  }
  const e = at(high, 0, 0); o += `<text class="tick" x="${W - 2}" y="${e[1] + 13}" text-anchor="end">L/L\u2080</text>`
  for (const f of row(0, step, top, 20)) {
    const a = at(low, full, f)
    o += `<path d="${points([a, at(high, full, f)])}" stroke="var(--grid)"/><text class="tick" x="${a[0] - 4}" y="${a[1] + 4}" text-anchor="end">${fmt(f, places)}</text>`
  }
  o += `<path d="${points([at(low, full, 0), at(low, full, top)])}" stroke="var(--edge)"/>`
  const z = s.tension; const n = s.lengths.length; const m = s.drives.length
  for (let j = m - 2; j >= 0; j--) {
    for (let i = 0; i + 2 < n; i += 2) {
      const c = [[i, j], [i + 2, j], [i + 2, j + 1], [i, j + 1]]
      if (Math.max(...c.map(([a, b]) => z[b][a])) < 0.004 * top) continue
      const q = c.map(([a, b]) => at(s.lengths[a], s.drives[b], z[b][a])); const shade = (z[j][i] + z[j + 1][i + 2]) / 2
      o += `<path d="${points(q)}z" fill="var(--panel)"/><path d="${points(q)}z" fill="var(--q-tension)" fill-opacity="${(0.1 + 0.72 * shade / s.scale.top).toFixed(2)}" stroke="var(--q-tension)" stroke-opacity=".2" stroke-width=".5"/>`
    }
  }
  for (let j = m - 1; j > 0; j -= 2) {
    const l = s.lengths.map((x, i) => [x, z[j][i]]).filter(p => p[1] > 0.003 * top).map(p => at(p[0], s.drives[j], p[1]))
    if (l.length < 2) continue
    o += `<path d="${points(l)}" fill="none" stroke="${blue}" stroke-width="${j === m - 1 ? 2 : 1}"/>`
    const p = l.at(-1); const word = fmt(s.drives[j], s.drives[j] % 1 ? 1 : 0) + (j === m - 1 ? TS + s.unit : '')
    const far = p[0] > W - 40
    o += `<text class="tick" x="${p[0] + (far ? -3 : 5)}" y="${p[1] + (far ? -7 : 4)}" ${far ? 'text-anchor="end"' : ''} style="fill:${blue}">${word}</text>`
  }
  place.innerHTML = `<svg viewBox="0 0 ${W} ${h}" aria-hidden="true">${o}<circle class="here" r="4" fill="var(--ink)" stroke="var(--panel)" stroke-width="1.5" hidden></circle></svg><div class="tip" aria-live="polite" hidden></div>`
  place.spec = { s, at, n, m, W }
  place.zoomer ??= magnify(place)
  place.zoomer.chart.show(place.zoomer.range)
}
function show (place, i, j) {
  const { s, at, W } = place.spec
  place.at = [i, j]
  const f = s.tension[j][i]; const [x, y] = at(s.lengths[i], s.drives[j], f)
  const dot = place.querySelector('.here'); const tip = place.querySelector('.tip')
  dot.removeAttribute('hidden'); dot.setAttribute('cx', x); dot.setAttribute('cy', y)
  tip.hidden = false
  tip.textContent = `${fmt(f, 1)}${TS}N/cm\u00b2 at ${fmt(s.lengths[i], 3)} L\u2080, ${fmt(s.drives[j], 1)}${TS}${s.unit}`
  const [px, py] = fromDrawing(place.querySelector('svg'), [x, y])
  tip.style.left = `${clamp(px - tip.offsetWidth / 2, 0, W - tip.offsetWidth)}px`; tip.style.top = `${Math.max(0, py - 32)}px`
}
function hide (place) { place.querySelector('.here')?.setAttribute('hidden', ''); const t = place.querySelector('.tip'); if (t) t.hidden = true }
addEventListener('pointermove', e => {
  const place = e.target.closest?.('.surface')
  for (const other of document.querySelectorAll('.surface')) if (other !== place && other !== document.activeElement) hide(other)
  if (!place?.spec) return
  if (place.zoomer.dragged) return
  const [X, Y] = inDrawing(place.querySelector('svg'), e); const { s, at, n, m } = place.spec
  let best = null
  for (let j = 0; j < m; j++) for (let i = 0; i < n; i++) { const [x, y] = at(s.lengths[i], s.drives[j], s.tension[j][i]); const d = (x - X) ** 2 + (y - Y) ** 2; if (!best || d < best.d) best = { d, i, j } }
  if (best.d < 900) show(place, best.i, best.j); else hide(place)
})
addEventListener('keydown', e => {
  const place = e.target.closest?.('.surface')
  const by = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[e.key]
  if (!place?.spec || !by || e.ctrlKey || e.altKey) return
  e.preventDefault()
  const { n, m } = place.spec; const [i, j] = place.at ?? [n - 1, m - 1]; const times = e.shiftKey ? 10 : 1
  show(place, clamp(i + by[0] * times, 0, n - 1), clamp(j + by[1] * times, 0, m - 1))
})
addEventListener('focusout', e => { if (e.target.matches?.('.surface')) hide(e.target) })
addEventListener('click', e => { for (const d of document.querySelectorAll('details.more[open]')) if (!d.contains(e.target)) d.open = false })
events.addEventListener('escape', () => { for (const d of document.querySelectorAll('details.more[open]')) d.open = false })

let due = false; let width = 0
function look () {
  for (const place of document.querySelectorAll('.surface[data-surface]')) {
    const key = `${place.clientWidth}|${place.dataset.surface.length}|${place.dataset.surface}`
    if (place.drawn !== key) { place.drawn = key; surface(place) }
  }
  drawings()
}
const soon = () => { if (!due) { due = true; requestAnimationFrame(() => { due = false; look() }) } }
new MutationObserver(list => { if (list.some(m => m.type === 'childList' && [...m.addedNodes].some(n => n.nodeType === 1 && (n.matches('.cmp,.cmp *,.surface') || n.querySelector?.('.surface,canvas.drawn'))))) soon() })
  .observe(document.documentElement, { childList: true, subtree: true })
addEventListener('resize', () => { if (innerWidth !== width) { width = innerWidth; soon() } })
events.addEventListener('theme', soon)
soon()
