// Registers as textures, made anew only when there is a newer look. Internal to the room.
#pragma once

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "apron/debugger/Look.h"
#include "apron/ui/Workbench.h"

namespace apron::ui {

// Where a shot is drawn: the large register shares one texture, the others have one each.
enum class ShotUse : std::uint8_t { kLarge, kSmall, kTile };

// To be called with the window's context current, the destructor too.
class Textures {
 public:
  Textures() = default;
  ~Textures();
  Textures(const Textures&) = delete;
  Textures& operator=(const Textures&) = delete;

  // OpenGL's name of the shot's picture, with sharp cells; at most one upload a look and style.
  unsigned of(const debugger::Shot& shot, ShotUse use, const Style& style, const debugger::Range& range,
              std::uint64_t serial);
  std::uint64_t uploads() const { return uploads_; }

 private:
  struct One {
    unsigned id = 0;
    std::uint32_t width = 0, height = 0;
    std::uint64_t serial = 0;
    debugger::PaletteId palette = debugger::PaletteId::kGrey;
    debugger::Range range;
  };
  void upload(One& one, const debugger::Shot& shot);

  std::map<std::pair<std::size_t, ShotUse>, One> all_;
  std::vector<std::uint8_t> rgba_;
  std::uint64_t uploads_ = 0;
};

}  // namespace apron::ui
