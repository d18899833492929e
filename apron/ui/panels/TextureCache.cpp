#include "apron/ui/panels/TextureCache.h"

#include <epoxy/gl.h>

#include <algorithm>

namespace apron::ui {

TextureCache::~TextureCache() {
  for (const auto& [key, one] : entries_) glDeleteTextures(1, &one.id);
}

unsigned TextureCache::get(const debugger::SampledRegister& sample, const CellLayout& layout,
                           TextureSlot slot, const RegisterStyle& style, const debugger::ValueRange& range,
                           std::uint64_t serial) {
  Entry& entry = entries_[{slot == TextureSlot::kFull ? 0 : sample.reg, slot}];
  const bool current = entry.id != 0 && entry.serial == serial && entry.palette == style.palette &&
                       entry.range.low == range.low && entry.range.high == range.high;
  if (current) return entry.id;
  entry.serial = serial;
  entry.palette = style.palette;
  entry.range = range;
  debugger::apply_palette(style.palette, range, sample.cells, rgba_);
  if (layout.hexagonal()) shift_rows(sample, layout);
  upload(entry, layout.hexagonal() ? 2 * sample.width + 1 : sample.width, sample.height);
  return entry.id;
}

// A brick is two pixels wide; the pixel beside a row is transparent.
void TextureCache::shift_rows(const debugger::SampledRegister& sample, const CellLayout& layout) {
  const std::size_t width = 2 * std::size_t{sample.width} + 1;
  bricks_.assign(4 * width * sample.height, 0);
  for (std::uint32_t y = 0; y < sample.height; ++y)
    for (std::uint32_t x = 0; x < sample.width; ++x) {
      const std::uint8_t* const colour = &rgba_[4 * (std::size_t{y} * sample.width + x)];
      std::uint8_t* const brick = &bricks_[4 * (y * width + 2 * x + (layout.is_shifted(y) ? 1 : 0))];
      std::copy_n(colour, 4, brick);
      std::copy_n(colour, 4, brick + 4);
    }
  rgba_.swap(bricks_);
}

void TextureCache::upload(Entry& entry, std::uint32_t columns, std::uint32_t rows) {
  ++uploads_;
  const auto width = static_cast<GLsizei>(columns), height = static_cast<GLsizei>(rows);
  if (entry.id == 0) glGenTextures(1, &entry.id);
  glBindTexture(GL_TEXTURE_2D, entry.id);
  if (entry.width != columns || entry.height != rows) {
    entry.width = columns;
    entry.height = rows;
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
