// The page Recordings: its keys, and one cursor and one zoom over its charts, its loop, and the muscle that plays a recording.
import { sample, showSpan, showTime } from './charts.js'
import { notify } from './elements.js'
import { key } from './lab.js'
import { drawStage } from './muscle.js'
import { draws } from './plot.js'
import { TS, escape, fmt } from './words.js'

const all = s => [...document.querySelectorAll(s)]
// The button of a note says where the pointer was last.
document.addEventListener('click', e => notify(e.target.closest?.('#note'), 'note', window.atCursor ?? null), true)
const click = id => document.getElementById(id)?.click()
key('n', 'note at the cursor', () => click('note'))
key('p', 'play the recording, and hold it', () => play(!playing))
key('/', 'search', () => document.getElementById('search')?.focus())
key('Delete', 'delete the chosen recordings', () => click('delete'))

// ---------------------------------------------------------------- the cursor
const SPEEDS = [0.1, 0.5, 1, 2, 10]
let speed = 1; let playing = false; let last = 0
const ends = () => all('.player').reduce(([a, b], p) => [Math.min(a, p.spec?.time[0] ?? a), Math.max(b, p.spec?.time.at(-1) ?? b)], [Infinity, -Infinity])
/** Put the cursor to a time, everywhere but in the chart that the pointer is in, which has it. */
function cursor (t, pointed = null) {
  window.atCursor = t
  for (const figure of all('.overlay figure.chart')) if (figure !== pointed) showTime(figure, t)
  for (const place of all('.player')) if (place.spec) picture(place, t)
  said(t)
}
function said (t) {
  const slide = document.querySelector('.playbar input'); const words = `${fmt(t, 3)}${TS}s`
  if (!slide) return
  slide.value = t; slide.setAttribute('aria-valuetext', words); document.querySelector('.playbar output').textContent = words
}
// The pointer's place in the field of a chart over time is a time, of the part that is shown.
document.addEventListener('pointermove', e => {
  const field = e.target.closest?.('.timed .u-over')
  if (!field || playing) return
  const figure = field.closest('figure'); const [low, high] = (figure.zoomed ?? figure.whole).x; const box = field.getBoundingClientRect()
  cursor(low + (e.clientX - box.left) / box.width * (high - low), figure)
})
let following = false
document.addEventListener('view', e => {
  if (following || !e.target.closest?.('.timed')) return
  following = true
  for (const { zoomer } of all('.timed .plot')) if (zoomer && zoomer.surface !== e.target) { if (e.detail) zoomer.take({ x: e.detail.x, y: zoomer.now.y }); else zoomer.reset() }
  for (const figure of all('.overlay figure.chart')) showSpan(figure, e.detail?.x ?? null)
  following = false
})

// ---------------------------------------------------------------- the muscle
function picture (place, t) {
  const { time, muscle, limits, range, letter, name, ...series } = place.spec
  const i = Math.max(0, sample(time, t)); const now = Object.fromEntries(Object.entries(series).map(([q, values]) => [q, values[i] ?? NaN]))
  const canvas = place.querySelector('canvas')
  drawStage(canvas, place.clientWidth, place.clientWidth < 520 || all('.player').length > 1, { muscle, now, limits, range, recorded: true })
  canvas.setAttribute('aria-label', `The muscle of ${letter}, ${name}, drawn to scale at ${fmt(time[i], 2)} s: length ${fmt(now.length, 2)} cm, pressure ${fmt(now.pressure, 2)} bar, tension ${fmt(now.tension, 1)} N`)
}
draws('.player', (place, spec) => {
  place.spec = spec
  if (!place.firstChild) place.innerHTML = `<span class="ab on">${escape(spec.letter)}</span><canvas role="img"></canvas>`
  controls(place.parentElement)
  picture(place, window.atCursor ?? spec.time[0])
})
function controls (players) {
  const [low, high] = ends(); let bar = players.querySelector('.playbar')
  if (!bar) {
    players.insertAdjacentHTML('beforeend', `<div class="playbar row"><button class="btn s" type="button">Play <kbd>P</kbd></button><span class="field s"><select aria-label="Speed">${SPEEDS.map(v => `<option value="${v}"${v === speed ? ' selected' : ''}>${v === 1 ? 'real time' : `${v} \u00d7`}</option>`).join('')}</select></span><input class="grow" type="range" aria-label="Time"><output class="num"></output></div>`)
    bar = players.querySelector('.playbar')
    bar.querySelector('button').onclick = () => play(!playing)
    bar.querySelector('select').onchange = e => { speed = +e.target.value }
    bar.querySelector('input').oninput = e => cursor(+e.target.value)
  }
  players.append(bar) // below the muscles
  Object.assign(bar.querySelector('input'), { min: low, max: high, step: (high - low) / 2000 || 1 })
  const at = window.atCursor
  if (at >= low && at <= high) cursor(at); else { window.atCursor = undefined; said(low) }
}
function play (on) {
  const button = document.querySelector('.playbar button')
  if (!button) return
  const [low, high] = ends()
  if (on && !(window.atCursor >= low && window.atCursor < high - 1e-6)) cursor(low)
  if (on && !playing) { last = performance.now(); requestAnimationFrame(go) }
  playing = on
  button.innerHTML = `${on ? 'Hold' : 'Play'} <kbd>P</kbd>`
}
function go (t) {
  if (!playing) return
  const [, high] = ends()
  if (!Number.isFinite(high)) { playing = false; return } // another choice of recordings has none
  cursor(Math.min(high, window.atCursor + Math.max(0, t - last) / 1000 * speed)); last = t
  if (window.atCursor >= high) play(false); else requestAnimationFrame(go)
}
