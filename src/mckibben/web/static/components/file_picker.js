// Quasar's uploader without a template: see markup.js.
export default {
  props: { url: String },
  render () {
    const url = (this.url.startsWith('/') ? window.path_prefix ?? '' : '') + this.url
    return Vue.h(Vue.resolveComponent('q-uploader'), { ref: 'qRef', url }, this.$slots)
  }
}
