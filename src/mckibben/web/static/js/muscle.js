// The muscle to scale: braid angle and diameter move with the length, by the table that came with it.
import { TS, clamp, fmt, row, size as projected, token } from './words.js'

export const PX = 37.8 // of a centimetre on the screen
const SCALES = [1, 0.75, 0.5, 0.4, 1 / 3, 0.25, 0.2, 0.1, 0.05, 0.02]

/** Angle [deg] and diameter [cm] of a braid at a length [cm]; without a braid NaN and a width that is only drawn. */
export function braid (m, length) {
  if (!m.braid) return { angle: NaN, diameter: m.rest_length * 7 }
  const t = m.braid.table; const at = clamp(length / 100, t.length[0], t.length.at(-1))
  let i = 1; let end = t.length.length - 1
  while (i < end) { const middle = (i + end) >> 1; if (t.length[middle] < at) i = middle + 1; else end = middle }
  const share = (at - t.length[i - 1]) / (t.length[i] - t.length[i - 1])
  const between = v => v[i - 1] + share * (v[i] - v[i - 1])
  return { angle: between(t.angle) * 180 / Math.PI, diameter: between(t.diameter) * 100 }
}

/** Draw it from x to the right, `px` a centimetre. */
export function drawMuscle (g, m, length, px, x, y, { pressure = 0, top = 6, threads = 14, thin = 0.9 } = {}) {
  const { diameter } = braid(m, length)
  const R = diameter / 2 * px; const W = clamp(length * px, 0, 4000); const r0 = Math.min(R * 0.8, 0.34 * px)
  const taper = Math.min(W * 0.12, Math.max(R * 1.1, 0.5 * px))
  const radius = t => { const a = clamp(Math.min(t, W - t) / taper, 0, 1); return r0 + (R - r0) * a * a * (3 - 2 * a) }
  const out = new Path2D()
  for (let i = 0; i <= 40; i++) { const t = W * i / 40; if (i) out.lineTo(x + t, y - radius(t)); else out.moveTo(x + t, y - radius(t)) }
  for (let i = 40; i >= 0; i--) { const t = W * i / 40; out.lineTo(x + t, y + radius(t)) }
  out.closePath()
  g.save()
  g.fillStyle = token('--raised'); g.fill(out)
  const full = clamp(pressure / top, 0, 1)
  if (full > 0.002) { g.globalAlpha = 0.06 + 0.5 * full; g.fillStyle = token('--q-pressure'); g.fill(out); g.globalAlpha = 1 }
  const turns = m.braid ? m.braid.turns : 2.5; const n = clamp(Math.round(W / 7), 24, 400); const lines = new Path2D()
  for (const hand of [1, -1]) {
    for (let j = 0; j < threads; j++) {
      let pen = false; const phase = 2 * Math.PI * j / threads
      for (let i = 0; i <= n; i++) {
        const t = W * i / n; const f = hand * 2 * Math.PI * turns * t / W + phase
        if (Math.cos(f) < -0.02) { pen = false; continue }
        const yy = y + radius(t) * Math.sin(f)
        if (pen) lines.lineTo(x + t, yy); else { lines.moveTo(x + t, yy); pen = true }
      }
    }
  }
  g.strokeStyle = token('--ink'); g.globalAlpha = 0.62; g.lineWidth = thin; g.stroke(lines); g.globalAlpha = 1
  const shade = g.createLinearGradient(0, y - R, 0, y + R)
  const ink = token('--ink')
  for (const [at, a] of [[0, '33'], [0.32, '00'], [0.6, '08'], [1, '47']]) shade.addColorStop(at, ink + a)
  g.fillStyle = shade; g.fill(out)
  g.lineWidth = 1; g.strokeStyle = ink; g.stroke(out)
  g.restore()
  return R
}
export function fitting (g, x, y, px, hand = 1) {
  const w = 0.9 * px; const r = 0.42 * px; const left = hand > 0 ? x : x - w
  g.save()
  g.fillStyle = token('--sunken'); g.strokeStyle = token('--ink'); g.lineWidth = 1
  g.beginPath(); g.roundRect(left, y - r, w, 2 * r, 2); g.fill(); g.stroke()
  g.globalAlpha = 0.45
  for (const f of [0.28, 0.5, 0.72]) { g.beginPath(); g.moveTo(x + hand * f * w, y - r); g.lineTo(x + hand * f * w, y + r); g.stroke() }
  g.restore()
}
/** A canvas as sharp as the screen; its context in CSS pixels. */
export function sharp (canvas, w, h) {
  const px = devicePixelRatio
  if (canvas.width !== Math.round(w * px) || canvas.height !== Math.round(h * px)) {
    canvas.width = Math.round(w * px); canvas.height = Math.round(h * px); canvas.style.width = `${w}px`; canvas.style.height = `${h}px`
  }
  const g = canvas.getContext('2d')
  g.setTransform(px, 0, 0, px, 0, 0)
  g.clearRect(0, 0, w, h)
  return g
}
/** A small one for lists: all to one scale. */
export function small (canvas, m, px, w) {
  const length = m.rest_length * 100; const { diameter } = braid(m, length); const h = Math.max(12, diameter * px + 4)
  const g = sharp(canvas, w, h)
  fitting(g, 14, h / 2, px, -1); drawMuscle(g, m, length, px, 14, h / 2, { threads: 9, thin: 0.6 }); fitting(g, 14 + length * px, h / 2, px, 1)
}

function words (g, text, x, y, { size = 11, weight = 400, colour = '--ink-3', align = 'left', style = '' } = {}) {
  g.font = `${style} ${weight} ${projected(size)}px ${token('--font')}`; g.fillStyle = token(colour); g.textAlign = align; g.textBaseline = 'alphabetic'
  g.fillText(text, x, y)
}
function line (g, colour, width, ...points) {
  g.strokeStyle = token(colour); g.lineWidth = width; g.beginPath()
  points.forEach(([x, y], i) => { if (i) g.lineTo(x, y); else g.moveTo(x, y) })
  g.stroke()
}

/** The machine: wall, cell, muscle, rod; every value where it lives. */
export function drawStage (canvas, W, phone, { muscle, now, told = now, limits, range, dry, old, recorded }) {
  const H = phone ? 150 : 196 + (projected(1) > 1 ? 24 : 0); const g = sharp(canvas, W, H)
  const x0 = phone ? 40 : 112; const y = phone ? 70 : 88; const room = W - x0 - (phone ? 62 : 66)
  const rest = muscle.rest_length * 100; const most = room / PX / SCALES.at(-1) // what no stage holds is drawn as far as it goes
  const L = clamp(Number.isFinite(now.length) ? now.length : rest, 0, most)
  const far = Math.min(most, Math.max(rest * 1.1, range ? range[1] : 0, L))
  const scale = SCALES.find(s => far * PX * s <= room) ?? SCALES.at(-1)
  const k = PX * scale; const xe = x0 + L * k; const yr = phone ? 112 : 148
  const P = now.pressure; const top = limits.pressure
  // wall and cell
  const wx = x0 - (phone ? 30 : 72)
  for (let i = 0; i <= (phone ? 5 : 6); i++) line(g, '--edge', 1, [wx, y - 20 + i * 8], [wx - 7, y - 13 + i * 8])
  line(g, '--ink', 1.5, [wx, y - 22], [wx, y + (phone ? 22 : 26)])
  if (!phone) {
    line(g, '--ink', 3, [wx, y], [x0 - 34, y])
    g.fillStyle = token('--panel'); g.strokeStyle = token('--q-tension'); g.lineWidth = 1.5; g.beginPath(); g.roundRect(x0 - 66, y - 12, 26, 24, 2); g.fill(); g.stroke()
    words(g, 'F', x0 - 53, y + 4, { size: 12, weight: 600, colour: '--q-tension', align: 'center', style: 'italic' })
    words(g, `${recorded ? 'up to' : 'load cell'} ${fmt(limits.tension, 0)}${TS}N`, 14, y + 44)
  }
  // tube and valve
  const tx = x0 - 16; const left = phone ? 0 : 92
  for (const [colour, width, alpha] of [['--ink', 7, 1], ['--panel', 4.6, 1], ['--q-pressure', 4.6, 0.15 + 0.8 * clamp(P / top, 0, 1)]]) {
    g.globalAlpha = alpha; g.strokeStyle = token(colour); g.lineWidth = width; g.beginPath()
    g.moveTo(tx, y - 0.42 * k); g.lineTo(tx, y - 46); g.quadraticCurveTo(tx, y - 54, tx - 8, y - 54); g.lineTo(left, y - 54); g.stroke(); g.globalAlpha = 1
  }
  if (!phone) {
    if (projected(1) > 1) words(g, 'valve', 69, y - 25, { align: 'center' }) // beside its box there is no room
    else words(g, 'valve', 42, y - 50, { align: 'right' })
    g.fillStyle = token('--panel'); g.strokeStyle = token('--q-valve'); g.lineWidth = 1.5; g.beginPath(); g.roundRect(46, y - 68, 46, 28, 2); g.fill(); g.stroke()
    if (!recorded) words(g, `${fmt(told.valve, 0)}${TS}%`, 69, y - 50, { size: 12, weight: 600, colour: '--q-valve', align: 'center' })
  }
  fitting(g, x0, y, k, -1)
  const r = drawMuscle(g, muscle, L, k, x0, y, { pressure: P, top })
  fitting(g, xe, y, k, 1)
  // rod and arrow of the tension
  const rod = xe + 0.9 * k
  g.fillStyle = token('--sunken'); g.fillRect(rod, y - 4, Math.max(0, W - rod), 8)
  line(g, '--ink', 1, [rod, y - 4], [W, y - 4]); line(g, '--ink', 1, [rod, y + 4], [W, y + 4])
  const force = clamp(now.tension / limits.tension, 0, 1.2) * (phone ? 40 : 62)
  const ax = xe + 1.05 * k
  if (force > 2) { line(g, '--q-tension', 4, [ax, y], [ax + force, y]); g.fillStyle = token('--q-tension'); g.beginPath(); g.moveTo(ax + force + 9, y); g.lineTo(ax + force - 2, y - 6.5); g.lineTo(ax + force - 2, y + 6.5); g.fill() }
  if (now.tension > 0.05) words(g, `${fmt(told.tension, 1)}${TS}N`, Math.min(ax + Math.max(force, 30) / 2, W - 34), y - 12, { size: 12, weight: 600, colour: '--q-tension', align: 'center' })
  lens(g, muscle, L, x0 + L * k * 0.64, y, phone)
  const dx = x0 + L * k * (phone ? 0.14 : 0.3)
  line(g, '--ink', 1, [dx, y - r - 16], [dx, y - r]); line(g, '--ink', 1, [dx, y + r], [dx, y + r + 14])
  g.fillStyle = token('--ink'); g.beginPath(); g.moveTo(dx, y - r); g.lineTo(dx - 3, y - r - 6); g.lineTo(dx + 3, y - r - 6); g.moveTo(dx, y + r); g.lineTo(dx - 3, y + r + 6); g.lineTo(dx + 3, y + r + 6); g.fill()
  const wide = muscle.braid ? `D${TS}${fmt(braid(muscle, L).diameter, 2)}${TS}cm` : 'width not stated'; g.font = `600 ${projected(12)}px ${token('--font')}`
  const fits = dx + 7 + g.measureText(wide).width < x0 + L * k * 0.64 - (phone ? 24 : 34) || phone // beside the lens
  const before = dx - 7 - g.measureText(wide).width > tx + 8 // beside the tube
  const [at, align] = fits ? [dx + 7, 'left'] : before ? [dx - 7, 'right'] : [dx, 'center']
  words(g, wide, at, fits || before ? y - r - 8 : y + r + 28, { size: 12, weight: 600, colour: '--ink', align })
  ruler(g, { x0, yr, xe, y, k, far, rest, L: Number.isFinite(told.length) ? told.length : rest, range, phone })
  if (!phone) {
    const ratio = scale === 1 ? `1${TS}:${TS}1` : `1${TS}:${TS}${fmt(1 / scale, (1 / scale) % 1 > 0.01 ? 2 : 0)}`
    const short = range && `${recorded ? 'recorded' : 'the protocol\u2019s'} range, ${fmt(range[0], 1)} to ${fmt(range[1], 1)}${TS}cm`
    const full = short && `${short}${dry && projected(1) === 1 ? ' \u00b7 dashed below: what the dry run expects' : ''}`
    // before the sign of the rest length, which stands as low
    const ends = ([from, said]) => from + projected(15) + g.measureText(said).width < x0 + rest * k - 10
    const [from, said] = [[x0, full], [14, full], [x0, short]].find(ends) ?? [14, short]
    if (said) {
      words(g, '\u25ac', from, H - 8, { colour: '--q-length' })
      words(g, said, from + projected(15), H - 8)
    }
    const beside = !said || g.measureText(`${said} drawn ${ratio}`).width + x0 + 40 < W
    words(g, `drawn ${ratio}`, W - 12, beside ? H - 6 : projected(13), { align: 'right' })
  }
  return { scale, x0, k, old }
}
function lens (g, muscle, L, mx, y, phone) {
  const { angle } = braid(muscle, L)
  if (!Number.isFinite(angle)) return
  const a = angle * Math.PI / 180; const l = phone ? 24 : 34; const cx = Math.cos(a); const sx = Math.sin(a)
  g.save()
  g.beginPath(); g.arc(mx, y, l, 0, 2 * Math.PI); g.fillStyle = token('--panel'); g.fill(); g.strokeStyle = token('--ink'); g.lineWidth = 1.2; g.stroke()
  g.globalAlpha = 0.35; line(g, '--ink', 1, [mx - l * cx, y - l * sx], [mx + l * cx, y + l * sx]); g.globalAlpha = 1
  g.setLineDash([6, 2, 1, 2]); line(g, '--ink-2', 1, [mx - l, y], [mx + l, y]); g.setLineDash([])
  g.globalAlpha = 0.14; g.fillStyle = token('--ink'); g.beginPath(); g.moveTo(mx, y); g.arc(mx, y, l * 0.62, -a, 0); g.fill(); g.globalAlpha = 1
  line(g, '--ink', 2, [mx - l * cx, y + l * sx], [mx + l * cx, y - l * sx])
  g.restore()
  words(g, `\u03b8${TS}${fmt(angle, 1)}\u00b0`, phone ? mx + l + 3 : mx, phone ? y - 22 : y - l - 7, { size: 12, weight: 600, colour: '--ink', align: phone ? 'left' : 'center' })
}
function ruler (g, { x0, yr, xe, y, k, far, rest, L, range, phone }) {
  if (range) { g.fillStyle = token('--q-length'); g.globalAlpha = 0.35; const a = clamp(range[0], 0, far); g.fillRect(x0 + a * k, yr, Math.max(1, (clamp(range[1], 0, far) - a) * k), 7); g.globalAlpha = 1 }
  const end = Math.ceil(far * 1.02 * 2) / 2
  line(g, '--ink-2', 1, [x0, yr], [x0 + end * k, yr])
  const step = [1, 5, 10, 50, 100, 500].find(s => s * k / 10 >= 3 && !(phone && s < 5)) ?? 1000 // between two marks [mm]
  const every = [1, 2, 5, 10, 20, 50, 100].find(e => e * k >= 28) ?? 200 // between two numbers [cm]
  for (const i of row(0, step, Math.round(end * 10), 1000)) {
    const X = x0 + i * k / 10
    line(g, '--ink-2', i % 10 ? 0.7 : 1, [X, yr], [X, yr + (i % 10 ? i % 5 ? 4 : 6 : 9)])
    if (i % (10 * every) === 0) words(g, String(i / 10), X, yr + 21, { align: 'center' })
  }
  if (!phone) { words(g, 'cm', x0 - 10, yr + 21, { align: 'right' }); words(g, 'L\u2080', x0 + rest * k, yr + 21 + projected(13), { align: 'center' }) }
  g.setLineDash([2, 2]); line(g, '--q-length', 1, [xe, y + 14], [xe, yr]); g.setLineDash([])
  g.fillStyle = token('--q-length'); g.beginPath(); g.moveTo(xe, yr + 1); g.lineTo(xe + 5.5, yr - 8); g.lineTo(xe - 5.5, yr - 8); g.fill()
  words(g, `${fmt(L, 2)}${TS}cm`, xe - 9, yr - 6, { size: 12, weight: 600, colour: '--q-length', align: 'right' })
}
