#include "smartsurf/script/lua/PatternMatcher.h"

#include <cctype>
#include <string>
#include <utility>

#include "smartsurf/script/lua/Interpreter.h"

namespace smartsurf::script {
namespace {

constexpr std::size_t kSetCharactersPerStep = 4;

// True if `c` belongs to the class of the letter; an upper-case letter is the complement. Other characters
// stand for themselves.
bool in_class(unsigned char c, unsigned char letter) {
  constexpr std::string_view kLetters = "acdglpsuwx";
  constexpr int (*kTests[])(int) = {std::isalpha, std::iscntrl, std::isdigit, std::isgraph, std::islower,
                                    std::ispunct, std::isspace, std::isupper, std::isalnum, std::isxdigit};
  const std::size_t kind = kLetters.find(static_cast<char>(std::tolower(letter)));
  if (kind == kLetters.npos) return letter == c;
  return (kTests[kind](c) != 0) != (std::isupper(letter) != 0);
}

}  // namespace

PatternMatcher::PatternMatcher(std::string_view subject, std::string_view pattern,
                               std::function<void(std::size_t)> report_steps)
    : subject_(subject), pattern_(pattern), report_steps_(std::move(report_steps)) {}

PatternMatcher::~PatternMatcher() = default;

void PatternMatcher::count_steps(std::size_t steps) {
  steps_ += steps;
  if (steps_ >= kReportInterval) report_steps_(std::exchange(steps_, 0));
}

std::optional<std::size_t> PatternMatcher::match_at(std::size_t position) {
  capture_count_ = 0;
  depth_ = 0;
  const std::size_t end = match(position, 0);
  if (end == kNoMatch) return std::nullopt;
  return end;
}

std::size_t PatternMatcher::match(std::size_t s, std::size_t p) {
  if (++depth_ > kMaxDepth) throw ScriptError("pattern too complex");
  const std::size_t end = match_rest(s, p);
  --depth_;
  return end;
}

// Matches the pattern from `p` on against the subject from `s` on. Items that leave no choice are consumed in
// the loop; the others recurse.
std::size_t PatternMatcher::match_rest(std::size_t s, std::size_t p) {
  while (p < pattern_.size()) {
    count_steps();
    const char c = pattern_[p];
    if (c == '(') return at(p + 1) == ')' ? open_capture(s, p + 2, true) : open_capture(s, p + 1, false);
    if (c == ')') return close_capture(s, p + 1);
    if (c == '$' && p + 1 == pattern_.size()) return s == subject_.size() ? s : kNoMatch;
    if (c == '%' && at(p + 1) == 'b') {
      s = match_balanced(s, p + 2);
      if (s == kNoMatch) return kNoMatch;
      p += 4;
      continue;
    }
    if (c == '%' && at(p + 1) == 'f') {
      p += 2;
      if (at(p) != '[') throw ScriptError("missing '[' after '%f' in pattern");
      const std::size_t end = item_end(p);
      const auto before = static_cast<unsigned char>(s == 0 ? '\0' : subject_[s - 1]);
      const auto here = static_cast<unsigned char>(s < subject_.size() ? subject_[s] : '\0');
      if (in_set(before, p, end - 1) || !in_set(here, p, end - 1)) return kNoMatch;
      p = end;
      continue;
    }
    if (c == '%' && std::isdigit(static_cast<unsigned char>(at(p + 1))) != 0) {
      s = match_back_reference(s, at(p + 1));
      if (s == kNoMatch) return kNoMatch;
      p += 2;
      continue;
    }
    const std::size_t end = item_end(p);
    switch (at(end)) {
      case '?':
        if (matches_item(s, p, end))
          if (const std::size_t rest = match(s + 1, end + 1); rest != kNoMatch) return rest;
        p = end + 1;
        break;
      case '*':
        return match_greedy(s, p, end, 0);
      case '+':
        return match_greedy(s, p, end, 1);
      case '-':
        return match_lazy(s, p, end);
      default:
        if (!matches_item(s, p, end)) return kNoMatch;
        ++s;
        p = end;
    }
  }
  return s;
}

// The item [p, end) as often as possible, but at least `least` times.
std::size_t PatternMatcher::match_greedy(std::size_t s, std::size_t p, std::size_t end, std::size_t least) {
  std::size_t count = 0;
  while (matches_item(s + count, p, end)) ++count;
  for (; count + 1 > least; --count) {
    const std::size_t rest = match(s + count, end + 1);
    if (rest != kNoMatch) return rest;
    if (count == 0) break;
  }
  return kNoMatch;
}

std::size_t PatternMatcher::match_lazy(std::size_t s, std::size_t p, std::size_t end) {
  for (;; ++s) {
    const std::size_t rest = match(s, end + 1);
    if (rest != kNoMatch) return rest;
    if (!matches_item(s, p, end)) return kNoMatch;
  }
}

std::size_t PatternMatcher::match_balanced(std::size_t s, std::size_t p) {
  if (p + 1 >= pattern_.size()) throw ScriptError("malformed pattern (missing arguments to '%b')");
  const char open = pattern_[p], close = pattern_[p + 1];
  if (s >= subject_.size() || subject_[s] != open) return kNoMatch;
  std::size_t nested = 1;
  for (std::size_t i = s + 1; i < subject_.size(); ++i) {
    count_steps();
    if (subject_[i] == close) {
      if (--nested == 0) return i + 1;
    } else if (subject_[i] == open) {
      ++nested;
    }
  }
  return kNoMatch;
}

std::size_t PatternMatcher::open_capture(std::size_t s, std::size_t p, bool is_position) {
  if (capture_count_ >= kMaxCaptures) throw ScriptError("too many captures");
  captures_[capture_count_++] = {s, 0, !is_position, is_position};
  const std::size_t rest = match(s, p);
  if (rest == kNoMatch) --capture_count_;
  return rest;
}

std::size_t PatternMatcher::close_capture(std::size_t s, std::size_t p) {
  std::size_t i = capture_count_;
  while (i > 0 && !captures_[i - 1].open) --i;
  if (i == 0) throw ScriptError("invalid pattern capture");
  Capture& capture = captures_[i - 1];
  capture.length = s - capture.begin;
  capture.open = false;
  const std::size_t rest = match(s, p);
  if (rest == kNoMatch) capture.open = true;
  return rest;
}

std::size_t PatternMatcher::match_back_reference(std::size_t s, char digit) {
  const std::size_t i = digit - '1';  // wraps for '0', which is not a capture
  if (i >= capture_count_ || captures_[i].open)
    throw ScriptError("invalid capture index %" + std::to_string(i + 1) + " in pattern");
  const Capture& capture = captures_[i];
  if (capture.is_position) return kNoMatch;
  const std::string_view text = subject_.substr(capture.begin, capture.length);
  count_steps(text.size() / 16);
  return subject_.substr(s).starts_with(text) ? s + text.size() : kNoMatch;
}

// The index after the single-character item at `p`.
std::size_t PatternMatcher::item_end(std::size_t p) {
  const char first = pattern_[p++];
  if (first == '%') {
    if (p >= pattern_.size()) throw ScriptError("malformed pattern (ends with '%')");
    return p + 1;
  }
  if (first != '[') return p;
  const std::size_t begin = p;
  if (at(p) == '^') ++p;
  do {  // a ']' that comes first is a member
    if (p >= pattern_.size()) throw ScriptError("malformed pattern (missing ']')");
    if (pattern_[p++] == '%') ++p;
  } while (p >= pattern_.size() || pattern_[p] != ']');
  count_steps((p - begin) / kSetCharactersPerStep);
  return p + 1;
}

bool PatternMatcher::matches_item(std::size_t s, std::size_t p, std::size_t end) {
  count_steps();
  if (s >= subject_.size()) return false;
  const auto c = static_cast<unsigned char>(subject_[s]);
  switch (pattern_[p]) {
    case '.':
      return true;
    case '%':
      return in_class(c, static_cast<unsigned char>(pattern_[p + 1]));
    case '[':
      return in_set(c, p, end - 1);
    default:
      return static_cast<unsigned char>(pattern_[p]) == c;
  }
}

// `p` is the index of '[', `end` that of the closing ']'.
bool PatternMatcher::in_set(unsigned char c, std::size_t p, std::size_t end) {
  count_steps((end - p) / kSetCharactersPerStep);
  bool member = true;
  ++p;
  if (pattern_[p] == '^') {
    member = false;
    ++p;
  }
  for (; p < end; ++p) {
    const auto first = static_cast<unsigned char>(pattern_[p]);
    if (first == '%') {
      ++p;
      if (in_class(c, static_cast<unsigned char>(pattern_[p]))) return member;
    } else if (at(p + 1) == '-' && p + 2 < end) {
      if (first <= c && c <= static_cast<unsigned char>(pattern_[p + 2])) return member;
      p += 2;
    } else if (first == c) {
      return member;
    }
  }
  return !member;
}

}  // namespace smartsurf::script
