#include "apron/ui/Workbench.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

namespace apron::ui {

using debugger::Breakpoint;
using debugger::Mode;

namespace {

constexpr float kMostZoom = 4096.0F;

std::string place_name(const program::Program& program, std::size_t instruction) {
  if (instruction >= program.code.size()) return {};
  const std::uint32_t index = program.code[instruction].source_location;
  if (index >= program.source_locations.size()) return {};
  const program::SourceLocation& at = program.source_locations[index];
  return std::filesystem::path(program.files[at.file]).filename().string() + ":" + std::to_string(at.line);
}

}  // namespace

void Viewpoint::zoom_about(float at_x, float at_y, float factor) {
  const float to = std::clamp(zoom * factor, 1.0F, kMostZoom);
  const float kept = zoom / to;
  x = at_x + (x - at_x) * kept;
  y = at_y + (y - at_y) * kept;
  zoom = to;
  pan(0.0F, 0.0F);
}

// Never away from the register.
void Viewpoint::pan(float dx, float dy) {
  const float half = 0.5F / zoom;
  x = std::clamp(x + dx, half, 1.0F - half);
  y = std::clamp(y + dy, half, 1.0F - half);
}

Workbench::Workbench(debugger::FrontPanel& panel, Ask ask) : panel_(panel), ask_(std::move(ask)) {}

// ---- from the program -------------------------------------------------------------------------------------

void Workbench::show_program(program::Program program, const std::vector<debugger::SourceText>& texts,
                             std::uint64_t number) {
  const std::string selected = selected_ ? program_.registers[*selected_].name : "";
  std::vector<std::pair<std::string, Style>> styles;
  for (std::size_t r = 0; r < styles_.size(); ++r)
    if (styles_[r].by_person) styles.emplace_back(program_.registers[r].name, styles_[r]);
  program_ = std::move(program);
  number_ = number;
  listing_ = debugger::Listing(program_, texts);
  look_ = {};
  styles_.assign(program_.registers.size(), {});
  for (const auto& [name, style] : styles)
    if (const auto reg = find_register(name)) styles_[*reg] = style;
  selected_ = find_register(selected);
  if (!selected_) view = {};
  if (const auto all = listed(); !selected_ && !all.empty()) selected_ = all.front();
  small_visible.clear();
  if (!breakpoints_.empty()) send_breakpoints();
}

void Workbench::update(debugger::Look look) {
  if (look.program != number_) return;
  const bool arrived = look.hit && (!look_.hit || look.instruction != look_.instruction);
  look_ = std::move(look);
  ++serial_;
  if (arrived) listing_.reveal(look_.instruction);
  if (look_.large) statistics_ = debugger::statistics(look_.large->cells);
  if (panel_.read(panel_revision_, panel_state_)) take_appearances();
  if (clocked) measure_speed();
}

void Workbench::take_appearances() {
  for (const auto& [name, wanted] : panel_state_.appearances) {
    const auto reg = find_register(name);
    if (!reg || styles_[*reg].by_person) continue;
    if (wanted.palette) styles_[*reg].palette = *wanted.palette;
    styles_[*reg].automatic = !wanted.range;
    if (wanted.range) styles_[*reg].range = *wanted.range;
  }
  if (selected_by_person_ || panel_state_.latest_shown.empty()) return;
  if (const auto reg = find_register(panel_state_.latest_shown)) selected_ = reg;
}

void Workbench::measure_speed() {
  const auto now = std::chrono::steady_clock::now();
  const double passed = std::chrono::duration<double>(now - measured_at_).count();
  if (passed < 0.5) return;
  const bool known = look_.ticks >= measured_ticks_ && passed < 5.0;
  ticks_per_s_ = known ? static_cast<double>(look_.ticks - measured_ticks_) / passed : 0.0;
  measured_ticks_ = look_.ticks;
  measured_at_ = now;
}

debugger::LookRequest Workbench::request() const {
  debugger::LookRequest request;
  if (tiled())
    request.tiles = tiles();
  else
    request.large = selected_;
  request.small = small_visible;
  request.cell = cell_shown;
  request.profile = profile_shown;
  return request;
}

std::size_t Workbench::current_row() const {
  const debugger::Groups& rows = listing_.groups();
  return look_.instruction < rows.size() ? rows[look_.instruction] : 0;
}

bool Workbench::running() const {
  return look_.mode == Mode::kRunning || look_.mode == Mode::kWalking || look_.mode == Mode::kStepping;
}

std::string Workbench::state() const {
  const std::string place = place_name(program_, look_.instruction);
  switch (look_.mode) {
    case Mode::kRunning:
      // A surface that is held, or slow: what stands still for half a second has been waiting for it.
      if (look_.ticks > 0 && look_.ticks == measured_ticks_ && ticks_per_s_ == 0.0)
        return "Running: waiting for the surface";
      return "Running";
    case Mode::kWalking:
      return "Walking";
    case Mode::kStepping:
      return "Step: waiting for the surface";
    case Mode::kHeld:
      break;
    case Mode::kOver:
      switch (look_.status) {
        case vm::Status::kClosed:
          return "The surface ended the session";
        case vm::Status::kPeerLost:
          return "The surface was lost";
        case vm::Status::kRefused:
        case vm::Status::kFailed:
          return "Failed";
        default:
          return "Ended";
      }
  }
  if (!look_.hit) return "Held at " + place;
  if (*look_.hit >= breakpoints_.size()) return "Held at a breakpoint, " + place;
  const Breakpoint& met = breakpoints_[*look_.hit];
  if (met.kind == Breakpoint::Kind::kTick) return "Held: tick " + std::to_string(met.tick);
  if (met.kind == Breakpoint::Kind::kCondition) return "Held: " + met.condition;
  return "Held at the breakpoint " + place;
}

// ---- registers --------------------------------------------------------------------------------------------

std::vector<std::size_t> Workbench::listed() const {
  std::vector<std::size_t> all;
  const auto internal = [&](std::size_t r) {
    const std::string& name = program_.registers[r].name;
    return name.empty() || name.front() == '$' || name.front() == ':';
  };
  for (std::size_t r = 0; r < program_.registers.size(); ++r)
    if (temporaries_shown || !internal(r)) all.push_back(r);
  return all;
}

std::optional<std::size_t> Workbench::find_register(std::string_view name) const {
  for (std::size_t r = 0; r < program_.registers.size(); ++r)
    if (program_.registers[r].name == name) return r;
  return std::nullopt;
}

void Workbench::select(std::size_t reg) {
  const program::Register& next = program_.registers[reg];
  const bool same_shape = selected_ && program_.registers[*selected_].width == next.width &&
                          program_.registers[*selected_].height == next.height;
  if (!same_shape) view = {};
  selected_ = reg;
  selected_by_person_ = true;
  if (tiled()) set_tiled(false);
}

std::vector<std::size_t> Workbench::tiles() const {
  std::vector<std::size_t> all;
  for (const std::string& name : panel_state_.tiles)
    if (const auto reg = find_register(name)) all.push_back(*reg);
  return all;
}

bool Workbench::tiled() const {
  return tiled_by_person_.value_or(panel_state_.tiled) && !panel_state_.tiles.empty();
}

Style Workbench::style(std::size_t reg) const { return styles_[reg]; }

void Workbench::set_style(std::size_t reg, Style style) {
  style.by_person = true;
  styles_[reg] = style;
}

debugger::Range Workbench::range(const Style& style, const std::vector<float>& cells) const {
  if (style.palette == debugger::PaletteId::kRaw) return {0.0F, 255.0F};
  return style.automatic ? debugger::automatic_range(cells) : style.range;
}

std::optional<float> Workbench::value(const debugger::Cell& at) const {
  if (!look_.large || at.x >= look_.large->width || at.y >= look_.large->height) return std::nullopt;
  return look_.large->cells[std::size_t{at.y} * look_.large->width + at.x];
}

// ---- what the person does ---------------------------------------------------------------------------------

void Workbench::run() {
  orders_.emplace_back([](debugger::Session& s) { s.run(); });
}
void Workbench::hold() {
  orders_.emplace_back([](debugger::Session& s) { s.hold(); });
}
void Workbench::toggle() { running() ? hold() : run(); }
void Workbench::step(debugger::Unit unit) {
  follow = true;
  orders_.emplace_back([unit, rows = listing_.groups()](debugger::Session& s) { s.step(unit, rows); });
}
void Workbench::walk() {
  follow = true;
  const std::chrono::milliseconds period(1000 / std::max(lines_per_s, 1));
  orders_.emplace_back([period, rows = listing_.groups()](debugger::Session& s) { s.walk(period, rows); });
}
void Workbench::reset() {
  orders_.emplace_back([panel = &panel_](debugger::Session& s) {
    panel->clear_program();
    s.reset();
  });
}

void Workbench::watch(const debugger::Cell& at) {
  cell = at;
  orders_.emplace_back([at](debugger::Session& s) { s.watch(at); });
}

void Workbench::set_profiling(bool on) {
  if (on == profiling_) return;
  profiling_ = on;
  orders_.emplace_back([on](debugger::Session& s) { s.profile(on); });
}

float Workbench::parameter(const program::Parameter& parameter) const {
  return panel_.parameter(parameter.name).value_or(parameter.default_value);
}

void Workbench::set_parameter(const program::Parameter& parameter, float value) {
  panel_.set_parameter(parameter.name, std::clamp(value, parameter.low, parameter.high));
}

// ---- breakpoints ------------------------------------------------------------------------------------------

bool Workbench::has_breakpoint(const debugger::Listing::Row& row) const {
  return std::any_of(breakpoints_.begin(), breakpoints_.end(), [&](const Breakpoint& b) {
    return b.kind == Breakpoint::Kind::kLine && row.line == b.line && row.file == b.file;
  });
}

void Workbench::toggle_breakpoint(std::size_t row) {
  if (row >= listing_.rows().size() || !listing_.rows()[row].code) return;
  const debugger::Listing::Row& at = listing_.rows()[row];
  const auto found = std::find_if(breakpoints_.begin(), breakpoints_.end(), [&](const Breakpoint& b) {
    return b.kind == Breakpoint::Kind::kLine && at.line == b.line && at.file == b.file;
  });
  if (found != breakpoints_.end()) {
    breakpoints_.erase(found);
  } else {
    Breakpoint one;
    one.file = at.file;
    one.line = at.line;
    breakpoints_.push_back(one);
  }
  send_breakpoints();
}

void Workbench::add_tick_breakpoint(std::uint64_t tick) {
  Breakpoint one;
  one.kind = Breakpoint::Kind::kTick;
  one.tick = tick;
  breakpoints_.push_back(one);
  send_breakpoints();
}

std::string Workbench::add_condition(const std::string& condition) {
  Question question = ask_(condition, program_);
  if (!question.program) return question.wrong;
  Breakpoint one;
  one.kind = Breakpoint::Kind::kCondition;
  one.condition = condition;
  breakpoints_.push_back(one);
  send_breakpoints();
  return {};
}

void Workbench::switch_breakpoint(std::size_t number, bool on) {
  breakpoints_[number].on = on;
  send_breakpoints();
}

void Workbench::remove_breakpoint(std::size_t number) {
  breakpoints_.erase(breakpoints_.begin() + static_cast<std::ptrdiff_t>(number));
  send_breakpoints();
}

// Conditions that a changed program no longer understands go.
void Workbench::send_breakpoints() {
  std::vector<program::Program> questions;
  for (auto one = breakpoints_.begin(); one != breakpoints_.end();) {
    if (one->kind == Breakpoint::Kind::kCondition) {
      Question question = ask_(one->condition, program_);
      if (!question.program) {
        notice = "The breakpoint '" + one->condition + "' is gone: " + question.wrong;
        one = breakpoints_.erase(one);
        continue;
      }
      questions.push_back(std::move(*question.program));
    }
    ++one;
  }
  orders_.emplace_back([list = breakpoints_, questions = std::move(questions)](debugger::Session& s) {
    s.set_breakpoints(list, questions);
  });
}

}  // namespace apron::ui
