#include "apron/debugger/FrontPanel.h"

#include <algorithm>

namespace apron::debugger {
namespace {

// Breaks longer lines, because a program that prints no line ends would exhaust memory.
constexpr std::size_t kMaxColumns = 4000;

}  // namespace

void FrontPanel::append(std::string_view text) {
  for (const char c : text) {
    if (c == '\n' || state_.console.back().size() >= kMaxColumns) {
      state_.console.emplace_back();
      ++state_.total_lines;
      if (state_.console.size() > kMaxLines) state_.console.pop_front();
    }
    if (c != '\n') state_.console.back() += c;
  }
  ++revision_;
}

void FrontPanel::print(std::string_view text) {
  const std::lock_guard lock(mutex_);
  append(text);
}

void FrontPanel::note(std::string_view text) {
  const std::lock_guard lock(mutex_);
  if (!state_.console.back().empty()) append("\n");
  append("- ");
  append(text);
  append("\n");
}

void FrontPanel::label(std::string_view name, std::string_view text) {
  const std::lock_guard lock(mutex_);
  const auto found = std::ranges::find(state_.labels, name, &std::pair<std::string, std::string>::first);
  if (found == state_.labels.end())
    state_.labels.emplace_back(name, text);
  else if (found->second == text)
    return;
  else
    found->second = text;
  ++revision_;
}

Appearance& FrontPanel::appearance_of(std::string_view reg) {
  const auto found = state_.appearances.find(reg);
  return found != state_.appearances.end() ? found->second : state_.appearances[std::string(reg)];
}

// Returns true if the state changed: programs repeat the same calls in every iteration.
bool FrontPanel::mark_shown(std::string_view reg, std::string_view title) {
  Appearance& appearance = appearance_of(reg);
  if (appearance.shown && appearance.title == title) return false;
  if (!appearance.shown) state_.tiles.emplace_back(reg);
  appearance.shown = true;
  appearance.title = title;
  ++revision_;
  return true;
}

void FrontPanel::show(std::string_view reg, std::string_view title) {
  const std::lock_guard lock(mutex_);
  const bool changed = mark_shown(reg, title);
  if (!changed && appearance_of(reg).enlarged) return;
  appearance_of(reg).enlarged = true;
  state_.last_shown = reg;
  ++revision_;
}

void FrontPanel::display(std::string_view reg, std::string_view title) {
  const std::lock_guard lock(mutex_);
  mark_shown(reg, title);
}

void FrontPanel::tile(int columns) {
  const std::lock_guard lock(mutex_);
  if (state_.tiled && state_.tile_columns == columns) return;
  state_.tiled = true;
  state_.tile_columns = columns;
  ++revision_;
}

void FrontPanel::set_palette(std::string_view reg, std::string_view name) {
  const std::lock_guard lock(mutex_);
  appearance_of(reg).palette = common::find_palette(name).value_or(common::Palette::kGrey);
  ++revision_;
}

void FrontPanel::set_scale(std::string_view reg, float low, float high) {
  const std::lock_guard lock(mutex_);
  appearance_of(reg).range = ValueRange{low, high};
  ++revision_;
}

std::optional<float> FrontPanel::parameter(std::string_view name) const {
  const std::lock_guard lock(mutex_);
  const auto found = parameters_.find(name);
  return found == parameters_.end() ? std::nullopt : std::optional(found->second);
}

void FrontPanel::set_parameter(std::string_view name, float value) {
  const std::lock_guard lock(mutex_);
  parameters_.insert_or_assign(std::string(name), value);
}

int FrontPanel::take_key() {
  const std::lock_guard lock(mutex_);
  if (unread_keys_.empty()) return 0;
  const int code = unread_keys_.front();
  unread_keys_.pop_front();
  return code;
}

bool FrontPanel::key_down(int code) const {
  const std::lock_guard lock(mutex_);
  return keys_down_.contains(code);
}

void FrontPanel::press_key(int code) {
  const std::lock_guard lock(mutex_);
  keys_down_.insert(code);
  if (unread_keys_.size() < kMaxUnreadKeys) unread_keys_.push_back(code);
}

void FrontPanel::release_key(int code) {
  const std::lock_guard lock(mutex_);
  keys_down_.erase(code);
}

void FrontPanel::release_all_keys() {
  const std::lock_guard lock(mutex_);
  keys_down_.clear();
}

bool FrontPanel::copy_if_changed(std::uint64_t& revision, State& state) const {
  const std::lock_guard lock(mutex_);
  if (revision == revision_) return false;
  revision = revision_;
  state = state_;
  return true;
}

void FrontPanel::clear_program() {
  const std::lock_guard lock(mutex_);
  state_.labels.clear();
  state_.appearances.clear();
  state_.last_shown.clear();
  state_.tiles.clear();
  state_.tiled = false;
  unread_keys_.clear();
  ++revision_;
}

}  // namespace apron::debugger
