// The page The paper: rows with theirs and ours, filters, progress, and the figures as small pictures.
import { notify } from './elements.js'
import { key, link } from './lab.js'
import { magnify } from './view.js'
import { TS, clamp, escape, say } from './words.js'

const SIGNS = {
  predicted: '<path d="M1.5 7l3.5 4 6.500-8.500" fill="none" stroke="var(--ink)" stroke-width="2"/>',
  arithmetic: '<path d="M2 5h10M2 9.500h10" fill="none" stroke="var(--ink)" stroke-width="1.8"/>',
  misprint: '<path d="M7 1l6.500 12H.5z" fill="var(--caution-edge)"/><path d="M7 5v4M7 10.300v1.600" stroke="var(--panel)" stroke-width="1.6"/>',
  open: '<circle cx="7" cy="7" r="5" fill="none" stroke="var(--ink)" stroke-width="1.6"/>',
  synthetic: '<path d="M7 .5l6.500 6.500L7 13.500.5 7z" fill="none" stroke="var(--ink)" stroke-width="1.5"/>',
  short: '<path d="M4.500 .5h5l4 4v5l-4 4h-5l-4-4v-5z" fill="var(--stop)"/><path d="M4.800 4.800l4.400 4.400M9.200 4.800l-4.400 4.400" stroke="var(--on-stop)" stroke-width="1.6"/>',
  'to come': '<path d="M1 7h2M6 7h2M11 7h2" stroke="var(--edge)" stroke-width="2.4"/>',
  repeats: '<path d="M3 5.500a4.500 4.500 0 1 1-.5 3.500M3 1.500v4h4" fill="none" stroke="var(--ink-2)" stroke-width="1.5"/>',
  unprinted: '<path d="M3 7h8" stroke="var(--ink-2)" stroke-width="1.6"/>',
  running: '<path d="M3 1.500l9 5.500-9 5.500z" fill="var(--ink)"/>'
}
const verdict = kind => fixed?.kinds.find(k => k.key === kind)?.one ?? kind
const sign = kind => `<svg width="14" height="14" viewBox="0 0 14 14" role="img" aria-label="${escape(verdict(kind))}">${SIGNS[kind] ?? SIGNS['to come']}</svg>`
const asked = new URLSearchParams(location.search)
const view = { only: SIGNS[asked.get('only')] ? asked.get('only') : '', search: (asked.get('search') ?? '').slice(0, 80), closed: new Set((asked.get('closed') ?? '').split(',').filter(Boolean)) }
let fixed = null; let state = { outcomes: {}, failed: {}, wanted: [], asked: {} }; let chosen = { row: '', figure: '' }
const $ = s => document.querySelector(s)
const narrow = matchMedia('(max-width:760px)')

/** What a row is now: its verdict, or what its print alone says of it. */
function kind (r) {
  if (state.failed[r.id]) return 'short'
  return state.outcomes[r.id]?.kind ?? 'to come'
}
const belongs = (r, only) => kind(r) === only || (kind(r) === 'to come' && r.kind === only)
const found = r => (!view.only || belongs(r, view.only)) && (!view.search || `${r.what} ${r.id} ${r.note} ${r.figures.map(f => `fig. ${f}`).join(' ')}`.toLowerCase().includes(view.search.toLowerCase()))

/** Tolerance in grey, the print as a tick, ours as a dot; beyond twice the tolerance an arrow. */
function gauge (r, o, w = 92) {
  const m = w / 2; const half = w * 0.37
  const range = / to /.test(r.paper)
  let s = `<rect x="${m - half}" y="4" width="${2 * half}" height="6" fill="var(--sunken)" stroke="var(--rule)" stroke-width=".5"/>`
  if (!range) s += `<path d="M${m} 1v12" stroke="var(--edge)"/>`
  const x = m + clamp(o.place, -1.25, 1.25) * half
  s += Math.abs(o.place) > 1.25 ? `<path d="M${x} 3l${Math.sign(o.place) * 5} 4l${-Math.sign(o.place) * 5} 4z" fill="var(--ink)"/>` : `<circle cx="${x}" cy="7" r="3.2" fill="var(--ink)"/>`
  return `<svg width="${w}" height="14" viewBox="0 0 ${w} 14" role="img" aria-label="${escape(o.difference)} from the print, tolerance plus or minus ${escape(o.half)}">${s}</svg>`
}
function row (r) {
  const o = state.outcomes[r.id]; const now = state.now === r.id; const waits = state.wanted.includes(r.id)
  const k = now ? 'running' : kind(r)
  const theirs = kind(r) === 'misprint' || r.kind === 'misprint' ? `<s>${escape(r.paper)}</s>` : escape(r.paper)
  const ours = o?.ours ? `<b>${escape(o.ours)}</b>` : `<span class="faint">${now ? 'running' : waits ? 'waits' : '\u2013'}</span>`
  const tolerance = o?.place !== undefined ? gauge(r, o) : now ? '<i class="busy"></i>' : k === 'misprint' ? '<span class="faint">corrected</span>' : ''
  const note = state.failed[r.id] ?? r.note
  const on = chosen.row === r.id
  return `<tr tabindex="0" data-row="${escape(r.id)}"${o ? ` data-value="${o.value}" data-verdict="${escape(o.kind)}"` : ''}${on ? ' class="sel" aria-selected="true"' : ''} title="${escape(r.id)}"><td>${sign(k)}</td><td class="what">${escape(r.what)}</td><td class="num">${theirs}</td><td class="num ours">${ours}</td><td class="dim unit">${escape(r.unit)}</td><td class="tolcell">${tolerance}</td><td class="faint notecell" title="${escape(note)}">${escape(note)}</td></tr>`
}
function rows () {
  const place = $('.p-root'); if (!place || !fixed) return
  const at = place.querySelector('.p-scroll')?.scrollTop ?? 0
  const focus = document.activeElement?.closest?.('.p-root tr')?.dataset; const had = focus && (focus.row ?? `part ${focus.part}`)
  let body = ''; let any = false
  for (const part of fixed.parts) {
    const all = fixed.rows.filter(r => r.part === part.id); const some = all.filter(found)
    if (!all.length || !some.length) continue
    any = true
    const done = all.filter(r => state.outcomes[r.id]).length; const run = all.filter(r => state.now === r.id).length; const rest = all.length - done - run
    const [name, ...more] = part.title.split('. ')
    const folded = view.closed.has(part.id) && !view.search && !view.only
    body += `<tr class="g" data-part="${part.id}" tabindex="0" aria-expanded="${!folded}"><td colspan="7"><span class="row"><svg width="9" height="9" viewBox="0 0 9 9" aria-hidden="true"><path d="${folded ? 'M2 0v9l6-4.500z' : 'M0 2h9L4.500 8z'}" fill="var(--ink-2)"/></svg>${escape(name)} <span class="faint more">${escape(more.join('. '))}</span><span class="grow"></span><span class="faint">${[`${done} done`, run && 'one running', rest && `${rest} to come`].filter(Boolean).join(', ')}</span></span></td></tr>`
    if (!folded) body += some.map(row).join('')
  }
  if (!any) body = `<tr class="none"><td colspan="7">No row is that${view.search ? `, or has \u201c${escape(view.search)}\u201d in it` : ''}. <button class="btn s" data-all>Show all rows</button></td></tr>`
  place.innerHTML = `<div class="p-scroll"><table role="treegrid" aria-label="Rows"><colgroup><col style="width:32px"><col><col style="width:108px"><col style="width:84px"><col style="width:86px"><col style="width:104px"><col class="nc"></colgroup><thead><tr><th><span class="vh">Verdict</span></th><th>What</th><th class="num">Paper</th><th class="num">Ours</th><th>Unit</th><th>Tolerance</th><th>Note</th></tr></thead><tbody>${body}</tbody></table></div>`
  place.querySelector('.p-scroll').scrollTop = at
  if (had) [...place.querySelectorAll('tr[tabindex]')].find(t => (t.dataset.row ?? `part ${t.dataset.part}`) === had)?.focus({ preventScroll: true })
}
function summary () {
  const place = $('.p-sum'); if (!place || !fixed) return
  const n = fixed.rows.length; const done = Object.keys(state.outcomes).length; const running = state.wanted.length > 0
  const left = state.left === null || state.left === undefined ? '' : ` \u00b7 about ${state.left < 90 ? `${Math.max(5, Math.round(state.left / 5) * 5)}${TS}s` : `${Math.round(state.left / 60)}${TS}min`} left`
  const words = running ? `running: ${escape(say(state.words))}${left}` : done === n ? 'every row is computed' : done ? `computed so far; ${n - done} rows are to come` : 'nothing is computed yet; Run all takes minutes, for some rows need recordings of the simulated machine'
  const count = k => fixed.rows.filter(r => kind(r) === k).length
  if (!place.querySelector('.p-progress')) {
    place.innerHTML = `<div class="p-progress"></div><div class="p-counts" role="group" aria-label="Show only">${fixed.kinds.map(k => `<button type="button" class="p-count" data-only="${escape(k.key)}"><span class="row">${sign(k.key)}<span class="n"></span></span><span>${escape(k.many)}</span></button>`).join('')}</div><div class="field s p-search"><input placeholder="Search rows" aria-label="Search rows" maxlength="80" value="${escape(view.search)}"><kbd>/</kbd></div><p class="p-headline"></p>`
  }
  place.querySelector('.p-progress').innerHTML = `<div class="row between small wrap"><b>${done} of ${n} rows done</b><span class="dim" role="status">${words}</span></div><svg height="8" width="100%" viewBox="0 0 ${n} 8" preserveAspectRatio="none" role="progressbar" aria-valuemin="0" aria-valuemax="${n}" aria-valuenow="${done}" aria-label="${done} of ${n} rows done"><rect width="${n}" height="8" fill="var(--sunken)"/><rect width="${done}" height="8" fill="var(--ink)"/>${running ? `<rect x="${done}" width="1" height="8" fill="var(--ink)" opacity=".4"/>` : ''}</svg>`
  place.querySelector('.p-headline').textContent = state.headline ?? ''
  for (const b of place.querySelectorAll('.p-count')) {
    const k = b.dataset.only
    const expected = count(k) ? 0 : fixed.rows.filter(r => belongs(r, k)).length
    b.querySelector('.n').textContent = count(k)
    b.title = [fixed.kinds.find(a => a.key === k).meaning, expected && `${expected} more to come`].filter(Boolean).join('; ')
    b.setAttribute('aria-pressed', String(view.only === k))
  }
}
function figures () {
  const place = $('.p-figures'); if (!place || !fixed) return
  const journal = fixed.figures.filter(f => !f.id.startsWith('1994')).length
  if (!place.querySelector('.figs')) place.innerHTML = `<div class="hd"><h2>Figures<small>${journal} of the first paper, ${fixed.figures.length - journal} of the second</small></h2></div><div class="figs">${fixed.figures.map(f => `<button type="button" data-figure="${f.id}" title="${escape(`${f.name}: ${f.title}`)}"><span class="pic"></span><span>${escape(f.name)}</span></button>`).join('')}</div>`
  for (const b of place.querySelectorAll('[data-figure]')) {
    const f = fixed.figures.find(g => g.id === b.dataset.figure); const pic = b.querySelector('.pic'); const small = $(`.p-pic[data-figure="${f.id}"]`)?.dataset.small
    if (small && !pic.querySelector('img')) pic.innerHTML = `<img alt="" src="${small}">`
    if (!small) pic.textContent = state.asked[f.id] ? '\u2026' : f.recordings ? 'from recordings' : ''
    if (b.dataset.figure === chosen.figure) b.setAttribute('aria-current', 'true'); else b.removeAttribute('aria-current')
  }
}
function numbers () {
  const place = $('.p-numbers'); if (!place || !fixed) return
  const asked = JSON.parse(place.dataset.numbers); const f = fixed.figures.find(g => g.id === asked.figure)
  const some = fixed.rows.filter(r => f.rows.includes(r.id))
  const text = JSON.stringify([asked, some.map(r => state.outcomes[r.id])])
  if (place.shown === text) return
  place.shown = text
  if (!some.length) { place.innerHTML = '<p class="p-caption">No number is printed for this figure.</p>'; return }
  place.innerHTML = some.map(r => {
    const o = state.outcomes[r.id]
    return `<div class="${asked.row === r.id ? 'sel' : ''}"><span class="w">${sign(kind(r))}<span>${escape(r.what)}</span></span><span class="g">${o?.place !== undefined ? gauge(r, o, 180) : ''}</span><span class="v"><span class="dim">${kind(r) === 'misprint' ? `<s>${escape(r.paper)}</s>` : escape(r.paper)}</span> <b>${escape(o?.ours ?? '\u2013')}</b> <span class="u">${escape(r.unit)}</span>${o?.difference ? ` <span class="faint">${escape(o.difference)}</span>` : ''}</span></div>`
  }).join('') + '<p class="p-caption faint">Theirs, then ours in bold. Grey is the tolerance, the tick the print, the dot ours.</p>'
}
function look () {
  for (const place of document.querySelectorAll('.p-svg')) place.zoomer ??= magnify(place)
  const root = $('.p-root'); if (!root) return
  if (root.dataset.fixed && !fixed) {
    fixed = JSON.parse(root.dataset.fixed)
    // on a narrow screen one part is open, so that the figure is not far below
    const open = fixed.rows.find(r => r.id === asked.get('row'))?.part ?? fixed.parts[0].id
    if (narrow.matches && !asked.has('closed')) view.closed = new Set(fixed.parts.map(p => p.id).filter(p => p !== open))
  }
  const s = root.dataset.state; const c = root.dataset.chosen
  const pics = document.querySelectorAll('.p-pic').length
  if (pics !== look.pics) { look.pics = pics; look.again = true }
  if (s && s !== look.s) { look.s = s; state = JSON.parse(s); look.again = true }
  if (c && c !== look.c) { look.c = c; chosen = JSON.parse(c); look.again = true }
  if (look.again) { look.again = false; all() }
  numbers()
}
function all () {
  summary(); figures()
  // the rows are written anew only where one of them has changed
  const now = JSON.stringify([state.outcomes, state.failed, state.now, state.wanted, chosen.row])
  if (all.rows !== now) { all.rows = now; rows(); if (!all.seen && chosen.row) { all.seen = true; centre() } }
}
function centre () { const box = $('.p-scroll'); const line = $('.p-root tr.sel'); if (box && line) box.scrollTop = line.offsetTop - box.clientHeight / 2 }
const pick = detail => notify($('.p-root'), 'pick', detail)
function chooseRow (id) {
  const r = fixed.rows.find(a => a.id === id); if (!r) return
  chosen = { row: id, figure: r.figures.includes(chosen.figure) ? chosen.figure : r.figures[0] ?? '' }
  look.c = ''; all(); pick({ row: id })
  if (narrow.matches) $('.p-right').scrollIntoView({ block: 'start' })
}
function keep () {
  link({ only: view.only || null, search: view.search || null, closed: [...view.closed].join(',') || null })
  summary(); rows()
}
document.addEventListener('click', e => {
  const t = e.target.closest?.('.p-root tr[data-row],.p-root tr.g,.p-count,.p-figures [data-figure],[data-all]')
  if (!t) return
  if (t.dataset.row) chooseRow(t.dataset.row)
  else if (t.dataset.part) { view.closed.has(t.dataset.part) ? view.closed.delete(t.dataset.part) : view.closed.add(t.dataset.part); keep() } else if (t.dataset.only) { view.only = view.only === t.dataset.only ? '' : t.dataset.only; keep() } else if (t.dataset.figure) { chosen = { ...chosen, figure: t.dataset.figure }; figures(); pick({ figure: t.dataset.figure }) } else if ('all' in t.dataset) { view.only = view.search = ''; $('.p-search input').value = ''; keep() }
})
document.addEventListener('input', e => { if (e.target.closest?.('.p-search')) { view.search = e.target.value.slice(0, 80); keep() } })
document.addEventListener('keydown', e => {
  const t = e.target.closest?.('.p-root tr[tabindex]')
  if (!t) return
  if (e.key === 'Enter' || e.key === ' ') { e.preventDefault(); t.click() }
  if (e.key === 'ArrowDown' || e.key === 'ArrowUp') {
    e.preventDefault()
    const list = [...document.querySelectorAll('.p-root tr[tabindex]')]
    list[clamp(list.indexOf(t) + (e.key === 'ArrowDown' ? 1 : -1), 0, list.length - 1)].focus()
  }
})
key('/', 'search rows', () => $('.p-search input')?.focus())
let due = false
new MutationObserver(() => { if (!due) { due = true; requestAnimationFrame(() => { due = false; look() }) } })
  .observe(document.documentElement, { childList: true, subtree: true, attributes: true, attributeFilter: ['data-state', 'data-chosen', 'data-fixed', 'data-numbers'] })
look()
