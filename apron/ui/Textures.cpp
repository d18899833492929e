#include "apron/ui/Textures.h"

#include <epoxy/gl.h>

namespace apron::ui {

Textures::~Textures() {
  for (const auto& [key, one] : all_) glDeleteTextures(1, &one.id);
}

unsigned Textures::of(const debugger::Shot& shot, ShotUse use, const Style& style,
                      const debugger::Range& range, std::uint64_t serial) {
  One& one = all_[{use == ShotUse::kLarge ? 0 : shot.reg, use}];
  const bool current = one.id != 0 && one.serial == serial && one.palette == style.palette &&
                       one.range.low == range.low && one.range.high == range.high;
  if (current) return one.id;
  one.serial = serial;
  one.palette = style.palette;
  one.range = range;
  debugger::paint(style.palette, range, shot.cells, rgba_);
  upload(one, shot);
  return one.id;
}

void Textures::upload(One& one, const debugger::Shot& shot) {
  ++uploads_;
  const auto width = static_cast<GLsizei>(shot.width), height = static_cast<GLsizei>(shot.height);
  if (one.id == 0) glGenTextures(1, &one.id);
  glBindTexture(GL_TEXTURE_2D, one.id);
  if (one.width != shot.width || one.height != shot.height) {
    one.width = shot.width;
    one.height = shot.height;
    glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, width, height, 0, GL_RGBA, GL_UNSIGNED_BYTE, rgba_.data());
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  } else {
    glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, width, height, GL_RGBA, GL_UNSIGNED_BYTE, rgba_.data());
  }
}

}  // namespace apron::ui
