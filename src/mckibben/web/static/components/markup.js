// HTML that the laboratory wrote, in an element of any tag. NiceGUI's own component is compiled from text in the browser,
// which the policy of the pages forbids; this one is the same as a function.
export default {
  props: { innerHTML: String, sanitize: Boolean, tag: String },
  data: () => ({ shown: null }),
  render () { return Vue.h(this.tag) },
  mounted () { this.put() },
  updated () { this.put() },
  methods: {
    put () {
      if (this.innerHTML === this.shown) return
      if (this.sanitize) this.$el.setHTML(this.innerHTML); else this.$el.innerHTML = this.innerHTML
      this.shown = this.innerHTML
    }
  }
}
