// Matches the patterns of Lua's string library (Lua manual, 6.4.1) by backtracking, and reports its steps, so
// that a caller can stop a pattern that backtracks exponentially.
//
// Lua's own matcher cannot be used. Thirty times 'a?' before thirty times 'a' take it 2³⁰ steps, in one call
// that neither the count hook nor an error from another thread interrupts, and four times '.-' take n⁴ steps
// of a text of n bytes. No check of pattern and text in advance tells these from harmless ones. A watchdog
// could only end the process, with its recording, where a script may expect an error that it can catch; and
// the point where it strikes depends on the machine, so that the same script with the same seed would end
// differently. Internal to this module.
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <optional>
#include <string_view>

namespace smartsurf::script {

class PatternMatcher {
 public:
  static constexpr std::size_t kMaxCaptures = 32;

  struct Capture {
    std::size_t begin = 0, length = 0;
    bool open = false, is_position = false;
  };

  // `pattern` is without the anchor. `report_steps` is called with the number of steps taken since its last
  // call, and may throw.
  PatternMatcher(std::string_view subject, std::string_view pattern,
                 std::function<void(std::size_t)> report_steps);
  ~PatternMatcher();

  // The end of the match that begins at `position`; nothing if there is none. Throws ScriptError for a
  // malformed pattern.
  std::optional<std::size_t> match_at(std::size_t position);

  // The captures of the last match.
  std::size_t capture_count() const { return capture_count_; }
  const Capture& capture(std::size_t i) const { return captures_[i]; }

 private:
  static constexpr int kMaxDepth = 200;
  static constexpr std::size_t kReportInterval = 1024;
  static constexpr std::size_t kNoMatch = -1;

  std::size_t match(std::size_t s, std::size_t p);
  std::size_t match_rest(std::size_t s, std::size_t p);
  std::size_t match_greedy(std::size_t s, std::size_t p, std::size_t next, std::size_t least);
  std::size_t match_lazy(std::size_t s, std::size_t p, std::size_t next);
  std::size_t match_balanced(std::size_t s, std::size_t p);
  std::size_t open_capture(std::size_t s, std::size_t p, bool is_position);
  std::size_t close_capture(std::size_t s, std::size_t p);
  std::size_t match_back_reference(std::size_t s, char digit);
  std::size_t item_end(std::size_t p);
  bool matches_item(std::size_t s, std::size_t p, std::size_t end);
  bool in_set(unsigned char c, std::size_t p, std::size_t end);
  char at(std::size_t p) const { return p < pattern_.size() ? pattern_[p] : '\0'; }
  void count_steps(std::size_t steps = 1);

  std::string_view subject_, pattern_;
  std::function<void(std::size_t)> report_steps_;
  std::array<Capture, kMaxCaptures> captures_{};
  std::size_t capture_count_ = 0, steps_ = 0;
  int depth_ = 0;
};

}  // namespace smartsurf::script
