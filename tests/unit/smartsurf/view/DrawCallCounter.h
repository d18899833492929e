// Counts OpenGL draw calls by replacing epoxy's function pointers.
//
// One instance at a time, on the drawing thread. epoxy resolves a function in its first call, which
// overwrites the replaced pointer: draw one frame before constructing a counter.
#pragma once

#include <epoxy/gl.h>

namespace smartsurf::view {

class DrawCallCounter {
 public:
  DrawCallCounter() {
    count_ = 0;
    elements_ = epoxy_glDrawElements;
    elements_instanced_ = epoxy_glDrawElementsInstanced;
    arrays_ = epoxy_glDrawArrays;
    arrays_instanced_ = epoxy_glDrawArraysInstanced;
    epoxy_glDrawElements = [](GLenum mode, GLsizei count, GLenum type, const void* indices) {
      ++count_;
      elements_(mode, count, type, indices);
    };
    epoxy_glDrawElementsInstanced = [](GLenum mode, GLsizei count, GLenum type, const void* indices,
                                       GLsizei instances) {
      ++count_;
      elements_instanced_(mode, count, type, indices, instances);
    };
    epoxy_glDrawArrays = [](GLenum mode, GLint first, GLsizei count) {
      ++count_;
      arrays_(mode, first, count);
    };
    epoxy_glDrawArraysInstanced = [](GLenum mode, GLint first, GLsizei count, GLsizei instances) {
      ++count_;
      arrays_instanced_(mode, first, count, instances);
    };
  }
  ~DrawCallCounter() {
    epoxy_glDrawElements = elements_;
    epoxy_glDrawElementsInstanced = elements_instanced_;
    epoxy_glDrawArrays = arrays_;
    epoxy_glDrawArraysInstanced = arrays_instanced_;
  }
  DrawCallCounter(const DrawCallCounter&) = delete;
  DrawCallCounter& operator=(const DrawCallCounter&) = delete;

  // Draw calls since construction.
  int count() const { return count_; }

 private:
  static inline int count_ = 0;
  // Saved by each instance, because epoxy replaces the pointers when it resolves the functions.
  static inline decltype(epoxy_glDrawElements) elements_ = nullptr;
  static inline decltype(epoxy_glDrawElementsInstanced) elements_instanced_ = nullptr;
  static inline decltype(epoxy_glDrawArrays) arrays_ = nullptr;
  static inline decltype(epoxy_glDrawArraysInstanced) arrays_instanced_ = nullptr;
};

}  // namespace smartsurf::view
