// What a page and its server say to each other where NiceGUI would evaluate text, which the policy of the pages forbids:
// fields tell their values in events, and the server calls functions by name.
import { link, tell } from './lab.js'

const element = id => document.getElementById(`c${id}`)
/** Functions that the server may call; a script of a page adds its own. */
export const calls = new Map(Object.entries({
  link,
  tell,
  openDialog: id => { const d = element(id); if (d && !d.open) d.showModal() },
  closeDialog: id => element(id)?.close(),
  setValue: (id, value) => { const e = element(id); if (e) e.value = value },
  runMethod: (...given) => window.runMethod(...given) // by which NiceGUI calls methods of components
}))
// NiceGUI evaluates what the server sends it; here that is a call, or nothing: the browser refuses all else.
const refused = window.eval
window.eval = text => {
  const call = /^(?:return )?(\w+)\(([^]*)\)$/.exec(text)
  if (calls.has(call?.[1])) return calls.get(call[1])(...JSON.parse(`[${call[2]}]`))
  if (/; window\.location\.reload\(\)$/.test(text)) return location.reload() // a page that missed too much
  return refused(text)
}

const send = (e, name, detail) => e.dispatchEvent(new CustomEvent(`lab-${name}`, { detail }))
for (const name of ['input', 'change']) {
  document.addEventListener(name, ({ target }) => {
    if (target.matches?.('input,select,textarea')) send(target, name, target.type === 'checkbox' ? target.checked : target.value)
  }, true)
}
document.addEventListener('keydown', e => { if (e.key === 'Enter' && e.target.matches?.('input')) send(e.target, 'enter', e.target.value) }, true)

// Files that are dropped on a place go to the picker that it names.
const zone = e => e.target.closest?.('[data-takes]')
document.addEventListener('dragover', e => { const z = zone(e); if (z) { e.preventDefault(); z.classList.add('over') } })
document.addEventListener('dragleave', e => zone(e)?.classList.remove('over'))
document.addEventListener('drop', e => {
  const z = zone(e)
  if (!z) return
  e.preventDefault()
  z.classList.remove('over')
  window.runMethod(z.dataset.takes, 'addFiles', [e.dataTransfer.files])
})
