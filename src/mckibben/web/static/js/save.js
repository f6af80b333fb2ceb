// The menu of a chart: saves it as a figure, which the server draws as those of the reports, and ends its zoom.
import { notify } from './elements.js'
import { events, tell } from './lab.js'
import { escape } from './words.js'

const WIDTHS = { column: 'Column, 86\u2009mm', page: 'Page, 178\u2009mm' }
const STYLES = { print: 'Print, colour', gray: 'Print, gray', screen: 'Screen', projector: 'Projector' }
const FORMATS = ['svg', 'pdf', 'png']
const ICON = '<svg width="14" height="14" viewBox="0 0 14 14" aria-hidden="true"><path d="M7 1v8M3.500 6L7 9.500 10.500 6M1.500 11v2h11v-2" fill="none" stroke="currentColor" stroke-width="1.500"/></svg>'
const kept = JSON.parse(localStorage.getItem('mckibben-figure') ?? '{}')
const choice = { width: WIDTHS[kept.width] ? kept.width : 'column', style: STYLES[kept.style] ? kept.style : 'print' }
const list = (name, label, options) => `<label class="small"><span>${label}</span><span class="field s"><select data-choice="${name}">${Object.entries(options).map(([v, words]) => `<option value="${v}"${choice[name] === v ? ' selected' : ''}>${words}</option>`).join('')}</select></span></label>`

/** Content of a menu, for the chart of a name. */
export function fill (menu) {
  const name = escape(menu.dataset.name ?? 'chart')
  menu.innerHTML = `<button type="button" class="btn s q rezoom" aria-label="Reset zoom of ${name}" hidden>Reset zoom</button><details><summary class="btn s q" title="Save figure" aria-label="Save figure: ${name}">${ICON}</summary><div class="sheet" role="group" aria-label="Save figure: ${name}"><b>Save figure</b>${list('width', 'Width', WIDTHS)}${list('style', 'Style', STYLES)}<div class="row">${FORMATS.map(f => `<button type="button" class="btn s" data-format="${f}">${f.toUpperCase()}</button>`).join('')}</div></div></details>`
}
const boxOf = e => e.closest('.chartbox')
const surfaceOf = box => box?.matches('[data-zooms]') && box.zoomer ? box : [...box?.querySelectorAll('[data-zooms]') ?? []].find(e => e.zoomer)

/** Save what a script has drawn itself: its document goes to the server, which answers with a file. */
async function send (document_, wish) {
  const answer = await fetch('/figure', { method: 'POST', body: JSON.stringify({ ...wish, chart: document_ }) }).catch(() => null)
  if (!answer?.ok) { tell(answer ? await answer.text() : 'The figure did not reach the server.'); return }
  const url = URL.createObjectURL(await answer.blob()); const a = document.createElement('a')
  a.href = url; a.download = decodeURIComponent(answer.headers.get('x-name') ?? `chart.${wish.format}`)
  a.click()
  setTimeout(() => URL.revokeObjectURL(url), 10_000)
}
addEventListener('click', e => {
  for (const d of document.querySelectorAll('.savefig details[open]')) if (!d.contains(e.target)) d.open = false
  const menu = e.target.closest?.('.savefig')
  if (!menu) return
  const surface = surfaceOf(boxOf(menu))
  if (e.target.closest('.rezoom')) { surface?.zoomer.reset(); (surface?.zoomer.keys ?? menu).focus?.() }
  const format = e.target.closest('[data-format]')?.dataset.format
  if (!format) return
  const wish = { ...choice, format, view: surface?.zoomer.range ?? null }
  menu.querySelector('details').open = false
  const own = boxOf(menu).figureDocument // of a page whose charts are drawn by scripts alone
  if (own) send(own(), wish); else notify(menu, 'save', wish)
})
addEventListener('change', e => {
  const name = e.target.dataset?.choice
  if (!name || !e.target.closest('.savefig')) return
  choice[name] = e.target.value
  localStorage.setItem('mckibben-figure', JSON.stringify(choice))
  for (const other of document.querySelectorAll(`.savefig select[data-choice=${name}]`)) other.value = choice[name]
})
addEventListener('view', e => {
  const menu = boxOf(e.target)?.querySelector('.savefig .rezoom')
  if (menu) menu.hidden = !e.detail
})
events.addEventListener('escape', () => { for (const d of document.querySelectorAll('.savefig details[open]')) d.open = false })

function look () { for (const menu of document.querySelectorAll('.savefig:empty')) fill(menu) }
let due = false
new MutationObserver(() => { if (!due) { due = true; requestAnimationFrame(() => { due = false; look() }) } }).observe(document.documentElement, { childList: true, subtree: true })
look()
