// Words of the field, explained where they stand: they are underlined in headings and labels without a change of the page.
import { key } from './lab.js'
import { clamp } from './words.js'

const $ = s => document.querySelector(s)
const PLACES = ['h2', 'h3', 'dt', 'th', 'label', 'legend', 'figcaption', '.cap', '.nm', '.sub', '.lim>span', '.law-name', '.minis span', '[aria-label="Measured properties"] td:first-child'].map(s => `main ${s}`).join()
const entries = new Map([...document.querySelectorAll('#words dt')].map(e => [e.textContent.toLowerCase(), e]))
const pattern = new RegExp(`(?<![\\w-])(${[...entries.keys()].sort((a, b) => b.length - a.length).map(w => w.replace(/ /g, '[\\s\u2009\u2060]+')).join('|')})(?=s?(?![\\w-]))`, 'gi')
const plain = text => text.toLowerCase().replace(/[\s\u2009\u2060]+/g, ' ')
let found = [] // {range, word} of the first place of each word

function look () {
  const seen = new Set(); found = []
  for (const place of document.querySelectorAll(PLACES)) {
    if (!place.offsetParent) continue
    const texts = document.createTreeWalker(place, NodeFilter.SHOW_TEXT)
    for (let node = texts.nextNode(); node; node = texts.nextNode()) {
      for (const m of node.data.matchAll(pattern)) {
        const word = plain(m[0]); const range = new Range()
        if (seen.has(word)) continue
        seen.add(word); range.setStart(node, m.index); range.setEnd(node, m.index + m[0].length); found.push({ range, word })
      }
    }
  }
  globalThis.CSS.highlights?.set('glossary', new Highlight(...found.map(f => f.range)))
}
function show (e) {
  const tip = $('#word')
  const inside = b => e.clientX >= b.left && e.clientX <= b.right && e.clientY >= b.top - 2 && e.clientY <= b.bottom + 2
  const one = found.find(f => f.range.startContainer.isConnected && inside(f.range.getBoundingClientRect()))
  tip.hidden = !one
  if (!one) return
  const b = one.range.getBoundingClientRect()
  tip.textContent = entries.get(one.word).nextSibling.firstChild.data
  tip.style.left = `${clamp(b.left, 4, Math.max(4, innerWidth - tip.offsetWidth - 4))}px`
  tip.style.top = `${b.bottom + 4 + tip.offsetHeight > innerHeight ? b.top - tip.offsetHeight - 4 : b.bottom + 4}px`
}
function list () {
  const here = new Set(found.map(f => f.word)); const dl = $('#words dl')
  const order = [...entries].sort(([a], [b]) => here.has(b) - here.has(a) || (a < b ? -1 : 1))
  dl.replaceChildren(...order.map(([word, dt]) => { dt.parentElement.classList.toggle('here', here.has(word)); return dt.parentElement }))
  $('#words').showModal()
}
let due = 0
new MutationObserver(() => { due ||= setTimeout(() => { due = 0; look() }, 800) }).observe(document.documentElement, { childList: true, subtree: true })
for (const name of ['pointermove', 'pointerdown']) addEventListener(name, show, { passive: true })
addEventListener('scroll', () => { $('#word').hidden = true }, { passive: true, capture: true })
$('#words-button').onclick = list
key('w', 'words of the field', list)
