// Scripted key presses, `--keys left@10-20`, for runs that can be repeated.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace apron::run {

// A key that is down from frame `first` on, and up from frame `end` on.
struct KeyPress {
  int code = 0;  // as in program/Keys.h
  std::uint64_t first = 0, end = 0;
};

// KEY@FRAME or KEY@FIRST-LAST. Returns nullopt and a one-line error for any other text.
std::optional<KeyPress> parse_key_press(std::string_view text, std::string& error);

class KeyScript {
 public:
  explicit KeyScript(std::vector<KeyPress> presses);

  bool is_down(int code, std::uint64_t frame) const noexcept;
  // The oldest press up to that frame that was not taken yet; 0: none.
  int take(std::uint64_t frame) noexcept;
  void restart() noexcept { taken_ = 0; }

 private:
  std::vector<KeyPress> presses_;  // in the order of their first frame
  std::size_t taken_ = 0;
};

}  // namespace apron::run
