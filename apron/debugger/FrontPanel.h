// The shared state of a program and its user interface: console, labels, registers to show and their
// palettes; sliders and switches. Thread-safe.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "apron/debugger/ColorMap.h"
#include "common/color/Palette.h"

namespace apron::debugger {

// The display settings that the program requests for a register.
struct Appearance {
  bool shown = false;     // by sim.show or sim.display
  bool enlarged = false;  // by sim.show
  std::string title;
  std::optional<common::Palette> palette;
  std::optional<ValueRange> range;  // nullopt: automatic
};

class FrontPanel {
 public:
  static constexpr std::size_t kMaxLines = 2000, kMaxUnreadKeys = 64;

  struct State {
    // The latest kMaxLines lines, oldest first; the last one may be incomplete.
    std::deque<std::string> console = {std::string()};
    std::uint64_t total_lines = 1;                               // started since construction
    std::vector<std::pair<std::string, std::string>> labels;     // name and text, in order of appearance
    std::map<std::string, Appearance, std::less<>> appearances;  // keyed by register name
    std::string last_shown;                                      // register of the last sim.show
    std::vector<std::string> tiles;                              // shown registers, in order of appearance
    bool tiled = false;                                          // show tiles instead of one large register
    int tile_columns = 0;                                        // 0: automatic
  };

  // Called by the program.
  void print(std::string_view text);
  void label(std::string_view name, std::string_view text);
  void show(std::string_view reg, std::string_view title);
  void display(std::string_view reg, std::string_view title);
  void tile(int columns);
  void set_palette(std::string_view reg, std::string_view name);
  void set_scale(std::string_view reg, float low, float high);
  std::optional<float> parameter(std::string_view name) const;
  // The oldest press that was not taken yet, as a code of program/Keys.h; 0: none.
  int take_key();
  bool key_down(int code) const;

  // Called by the user interface.
  void set_parameter(std::string_view name, float value);
  // A key went down or up. Presses beyond kMaxUnreadKeys are dropped until the program reads some.
  void press_key(int code);
  void release_key(int code);
  void release_all_keys();
  // Appends a console line that starts with "- ".
  void note(std::string_view text);
  // If the state has changed since `revision`, copies it, updates `revision` and returns true.
  bool copy_if_changed(std::uint64_t& revision, State& state) const;
  // Removes everything that the program has set; keeps sliders and console.
  void clear_program();

 private:
  void append(std::string_view text);
  Appearance& appearance_of(std::string_view reg);
  bool mark_shown(std::string_view reg, std::string_view title);

  mutable std::mutex mutex_;
  std::uint64_t revision_ = 1;
  State state_;
  std::map<std::string, float, std::less<>> parameters_;
  std::deque<int> unread_keys_;
  std::set<int> keys_down_;
};

}  // namespace apron::debugger
