// Registers as OpenGL textures, updated only for a newer snapshot. Internal to this module.
#pragma once

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "apron/debugger/DebugSnapshot.h"
#include "apron/ui/ViewModel.h"
#include "common/color/Palette.h"

namespace apron::ui {

// The place at which a sample is drawn. kFull uses a single texture, the others one per register.
enum class TextureSlot : std::uint8_t { kFull, kThumbnail, kTile };

// All functions and the destructor require the window's OpenGL context to be current.
class TextureCache {
 public:
  TextureCache() = default;
  ~TextureCache();
  TextureCache(const TextureCache&) = delete;
  TextureCache& operator=(const TextureCache&) = delete;

  // The OpenGL texture of the sample, magnified without interpolation. Uploads only if the serial, palette or
  // range has changed. Hexagons become bricks, of which every second row is shifted by half of one.
  // serial: ViewModel::snapshot_serial().
  unsigned get(const debugger::SampledRegister& sample, const CellLayout& layout, TextureSlot slot,
               const RegisterStyle& style, const debugger::ValueRange& range, std::uint64_t serial);
  std::uint64_t uploads() const { return uploads_; }

 private:
  struct Entry {
    unsigned id = 0;
    std::uint32_t width = 0, height = 0;
    std::uint64_t serial = 0;
    common::Palette palette = common::Palette::kGrey;
    debugger::ValueRange range;
  };
  void shift_rows(const debugger::SampledRegister& sample, const CellLayout& layout);
  void upload(Entry& entry, std::uint32_t width, std::uint32_t height);

  std::map<std::pair<std::size_t, TextureSlot>, Entry> entries_;
  std::vector<std::uint8_t> rgba_, bricks_;
  std::uint64_t uploads_ = 0;
};

}  // namespace apron::ui
