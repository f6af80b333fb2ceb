// The page Recordings: its keys, and the time under the pointer, where a note is to go.
import { notify } from './elements.js'
import { key } from './lab.js'

// The button of a note says where the pointer was last.
document.addEventListener('click', e => notify(e.target.closest?.('#note'), 'note', window.atCursor ?? null), true)
const click = id => document.getElementById(id)?.click()
key('n', 'note at the cursor', () => click('note'))
key('/', 'search', () => document.getElementById('search')?.focus())
key('Delete', 'delete the chosen recordings', () => click('delete'))

// The pointer's place in the field of a chart over time is a time, of the part that is shown.
document.addEventListener('pointermove', e => {
  const field = e.target.closest?.('.timed .u-over')
  if (!field) return
  const figure = field.closest('figure'); const [low, high] = (figure.zoomed ?? figure.whole).x; const box = field.getBoundingClientRect()
  window.atCursor = low + (e.clientX - box.left) / box.width * (high - low)
})
