// The shared state of a program and its user interface: console, labels, registers to show and their
// palettes; sliders and switches. Thread-safe.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/color/Palette.h"
#include "apron/debugger/ColorMap.h"

namespace apron::debugger {

// How the program wants a register to be shown.
struct Appearance {
  bool shown = false;     // by sim.show or sim.display
  bool enlarged = false;  // by sim.show
  std::string title;
  std::optional<common::Palette> palette;
  std::optional<ValueRange> range;  // else found out from the cells
};

class FrontPanel {
 public:
  static constexpr std::size_t kMaxLines = 2000;

  struct State {
    std::deque<std::string> console = {
        std::string()};             // whole lines, the oldest first, and last the one being written
    std::uint64_t total_lines = 1;  // ever begun
    std::vector<std::pair<std::string, std::string>> labels;     // name and text, in order of appearance
    std::map<std::string, Appearance, std::less<>> appearances;  // by register
    std::string last_shown;                                      // register
    std::vector<std::string> tiles;                              // registers, in order of appearance
    bool tiled = false;                                          // the tiles instead of one large register
    int tile_columns = 0;                                        // 0: as fits
  };

  // The program's side.
  void print(std::string_view text);
  void label(std::string_view name, std::string_view text);
  void show(std::string_view reg, std::string_view title);
  void display(std::string_view reg, std::string_view title);
  void tile(int columns);
  void set_palette(std::string_view reg, std::string_view name);
  void set_scale(std::string_view reg, float low, float high);
  std::optional<float> parameter(std::string_view name) const;

  // The person's side.
  void set_parameter(std::string_view name, float value);
  // A line of its own, begun by "- ".
  void note(std::string_view text);
  // Copies what has changed since `revision`, which is then the present one; false if nothing has.
  bool copy_if_changed(std::uint64_t& revision, State& state) const;
  // As before the program ran; sliders and console stay as they are.
  void clear_program();

 private:
  void append(std::string_view text);
  Appearance& appearance_of(std::string_view reg);
  bool mark_shown(std::string_view reg, std::string_view title);

  mutable std::mutex mutex_;
  std::uint64_t revision_ = 1;
  State state_;
  std::map<std::string, float, std::less<>> parameters_;
};

}  // namespace apron::debugger
