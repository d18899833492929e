#include "apron/run/host/KeyScript.h"

#include <algorithm>

#include "apron/program/Keys.h"
#include "common/text/Number.h"

namespace apron::run {
namespace {

bool parse_frame(std::string_view text, std::uint64_t& frame) {
  return common::parse_number(text, frame) && frame < UINT64_MAX;
}

}  // namespace

std::optional<KeyPress> parse_key_press(std::string_view text, std::string& error) {
  const std::size_t at = text.rfind('@');
  const std::string_view frames = at == text.npos ? "" : text.substr(at + 1);
  const std::size_t dash = frames.find('-');
  std::uint64_t first = 0, last = 0;
  if (at == text.npos || !parse_frame(frames.substr(0, dash), first) ||
      !parse_frame(dash == frames.npos ? frames : frames.substr(dash + 1), last) || last < first) {
    error = "'" + std::string(text) + "' is not KEY@FRAME or KEY@FIRST-LAST, such as left@10-20";
    return std::nullopt;
  }
  const std::string_view name = text.substr(0, at);
  const std::optional<int> code = program::key_code(name);
  if (!code) {
    error = program::unknown_key_message(name);
    return std::nullopt;
  }
  return KeyPress{*code, first, last + 1};
}

KeyScript::KeyScript(std::vector<KeyPress> presses) : presses_(std::move(presses)) {
  std::ranges::stable_sort(presses_, [](const KeyPress& a, const KeyPress& b) { return a.first < b.first; });
}

bool KeyScript::is_down(int code, std::uint64_t frame) const noexcept {
  return std::ranges::any_of(presses_, [&](const KeyPress& press) {
    return press.code == code && press.first <= frame && frame < press.end;
  });
}

int KeyScript::take(std::uint64_t frame) noexcept {
  return taken_ < presses_.size() && presses_[taken_].first <= frame ? presses_[taken_++].code : 0;
}

}  // namespace apron::run
