#include "apron/ui/panels/TextureCache.h"

#include <epoxy/gl.h>

namespace apron::ui {

TextureCache::~TextureCache() {
  for (const auto& [key, one] : entries_) glDeleteTextures(1, &one.id);
}

unsigned TextureCache::get(const debugger::SampledRegister& sample, TextureSlot slot,
                           const RegisterStyle& style, const debugger::ValueRange& range,
                           std::uint64_t serial) {
  Entry& entry = entries_[{slot == TextureSlot::kFull ? 0 : sample.reg, slot}];
  const bool current = entry.id != 0 && entry.serial == serial && entry.palette == style.palette &&
                       entry.range.low == range.low && entry.range.high == range.high;
  if (current) return entry.id;
  entry.serial = serial;
  entry.palette = style.palette;
  entry.range = range;
  debugger::apply_palette(style.palette, range, sample.cells, rgba_);
  upload(entry, sample);
  return entry.id;
}

void TextureCache::upload(Entry& entry, const debugger::SampledRegister& sample) {
  ++uploads_;
  const auto width = static_cast<GLsizei>(sample.width), height = static_cast<GLsizei>(sample.height);
  if (entry.id == 0) glGenTextures(1, &entry.id);
  glBindTexture(GL_TEXTURE_2D, entry.id);
  if (entry.width != sample.width || entry.height != sample.height) {
    entry.width = sample.width;
    entry.height = sample.height;
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
