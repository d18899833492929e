#include "apron/ui/ViewModel.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>

#include "common/text/Number.h"

namespace apron::ui {

using debugger::Breakpoint;
using debugger::ExecutionState;

namespace {

constexpr float kMaxZoom = 4096.0F;

std::string location_name(const program::Program& program, std::size_t instruction) {
  const program::SourceLocation* at = program::find_location(program, instruction);
  if (at == nullptr) return {};
  return std::filesystem::path(program.files[at->file]).filename().string() + ":" + std::to_string(at->line);
}

}  // namespace

void Viewport::zoom_about(float at_x, float at_y, float factor) {
  const float new_zoom = std::clamp(zoom * factor, 1.0F, kMaxZoom);
  const float scale = zoom / new_zoom;
  x = at_x + (x - at_x) * scale;
  y = at_y + (y - at_y) * scale;
  zoom = new_zoom;
  pan(0.0F, 0.0F);
}

// Clamps the view to the register.
void Viewport::pan(float dx, float dy) {
  const float half = 0.5F / zoom;
  x = std::clamp(x + dx, half, 1.0F - half);
  y = std::clamp(y + dy, half, 1.0F - half);
}

ViewModel::ViewModel(debugger::FrontPanel& panel, ConditionCompiler compile_condition)
    : panel_(panel), compile_condition_(std::move(compile_condition)) {}

// ---- program ----------------------------------------------------------------------------------------------

void ViewModel::show_program(program::Program program, const std::vector<debugger::SourceText>& texts,
                             std::uint64_t program_id) {
  const std::string selected = selected_ ? program_.registers[*selected_].name : "";
  std::vector<std::pair<std::string, RegisterStyle>> styles;
  for (std::size_t r = 0; r < styles_.size(); ++r)
    if (styles_[r].set_by_user) styles.emplace_back(program_.registers[r].name, styles_[r]);
  program_ = std::move(program);
  program_id_ = program_id;
  reads_keys_ = std::ranges::any_of(program_.code, [](const program::Instruction& in) {
    return in.op == program::Opcode::kKeyPressed || in.op == program::Opcode::kKeyDown;
  });
  listing_ = debugger::Listing(program_, texts);
  snapshot_ = {};
  styles_.assign(program_.registers.size(), {});
  for (const auto& [name, style] : styles)
    if (const auto reg = find_register(name)) styles_[*reg] = style;
  selected_ = find_register(selected);
  if (!selected_) viewport = {};
  if (const auto all = listed_registers(); !selected_ && !all.empty()) selected_ = all.front();
  visible_thumbnails.clear();
  locked_tiles_.clear();
  enlarged_history.reset();
  editor.set_sources(texts);
  if (!breakpoints_.empty()) send_breakpoints();
}

void ViewModel::update(debugger::DebugSnapshot snapshot) {
  if (snapshot.program_id != program_id_) return;
  const bool reached_breakpoint =
      snapshot.hit && (!snapshot_.hit || snapshot.instruction != snapshot_.instruction);
  snapshot_ = std::move(snapshot);
  ++snapshot_serial_;
  if (reached_breakpoint) listing_.reveal(snapshot_.instruction);
  if (snapshot_.full) statistics_ = debugger::compute_statistics(snapshot_.full->cells);
  if (panel_.copy_if_changed(panel_revision_, panel_state_)) apply_appearances();
  if (speed_shown) measure_speed();
}

void ViewModel::apply_appearances() {
  for (const auto& [name, wanted] : panel_state_.appearances) {
    const auto reg = find_register(name);
    if (!reg || styles_[*reg].set_by_user) continue;
    if (wanted.palette) styles_[*reg].palette = *wanted.palette;
    styles_[*reg].auto_range = !wanted.range;
    if (wanted.range) styles_[*reg].range = *wanted.range;
  }
  if (selected_by_user_ || panel_state_.last_shown.empty()) return;
  if (const auto reg = find_register(panel_state_.last_shown)) selected_ = reg;
}

void ViewModel::measure_speed() {
  const auto now = std::chrono::steady_clock::now();
  const double elapsed_s = std::chrono::duration<double>(now - measured_at_).count();
  if (elapsed_s < 0.5) return;
  const bool valid = snapshot_.ticks >= measured_ticks_ && elapsed_s < 5.0;
  ticks_per_s_ = valid ? static_cast<double>(snapshot_.ticks - measured_ticks_) / elapsed_s : 0.0;
  measured_ticks_ = snapshot_.ticks;
  measured_at_ = now;
}

debugger::SnapshotRequest ViewModel::snapshot_request() const {
  debugger::SnapshotRequest request;
  if (tiled())
    request.tiles = tiled_registers();
  else
    request.full = selected_;
  request.thumbnails = visible_thumbnails;
  request.include_probe = probe_shown;
  request.include_profile = profile_shown;
  return request;
}

std::size_t ViewModel::current_row() const {
  const debugger::InstructionGroups& rows = listing_.groups();
  return snapshot_.instruction < rows.size() ? rows[snapshot_.instruction] : 0;
}

std::optional<std::size_t> ViewModel::find_row(std::string_view query, std::size_t from) const {
  const std::vector<debugger::Listing::Row>& rows = listing_.rows();
  std::uint32_t line = 0;
  const bool is_line = common::parse_number(query, line);
  const auto same = [](unsigned char a, unsigned char b) { return std::tolower(a) == std::tolower(b); };
  const auto matches = [&](const debugger::Listing::Row& row) {
    if (is_line) return row.depth == 0 && row.line == line;
    return std::search(row.text.begin(), row.text.end(), query.begin(), query.end(), same) != row.text.end();
  };
  for (std::size_t i = 0; i < rows.size() && !query.empty(); ++i)
    if (const std::size_t row = (from + i) % rows.size(); matches(rows[row])) return row;
  return std::nullopt;
}

bool ViewModel::running() const {
  return snapshot_.mode == ExecutionState::kRunning || snapshot_.mode == ExecutionState::kWalking ||
         snapshot_.mode == ExecutionState::kStepping;
}

std::string ViewModel::state_text() const {
  const std::string location = location_name(program_, snapshot_.instruction);
  switch (snapshot_.mode) {
    case ExecutionState::kRunning:
      // No tick for half a second means that the surface is paused or slow.
      if (snapshot_.ticks > 0 && snapshot_.ticks == measured_ticks_ && ticks_per_s_ == 0.0)
        return "Running: waiting for the surface";
      return "Running";
    case ExecutionState::kWalking:
      return "Walking";
    case ExecutionState::kStepping:
      return "Step: waiting for the surface";
    case ExecutionState::kPaused:
      break;
    case ExecutionState::kFinished:
      switch (snapshot_.status) {
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
  if (!snapshot_.hit) return "Paused at " + location;
  if (*snapshot_.hit >= breakpoints_.size()) return "Paused at a breakpoint, " + location;
  const Breakpoint& breakpoint = breakpoints_[*snapshot_.hit];
  if (breakpoint.kind == Breakpoint::Kind::kTick) return "Paused: tick " + std::to_string(breakpoint.tick);
  if (breakpoint.kind == Breakpoint::Kind::kCondition)
    return "Paused: " + breakpoint.condition + (breakpoint.on_change ? " has changed" : "");
  return "Paused at the breakpoint " + location;
}

// ---- registers --------------------------------------------------------------------------------------------

std::vector<std::size_t> ViewModel::listed_registers() const {
  std::vector<std::size_t> registers;
  for (std::size_t r = 0; r < program_.registers.size(); ++r)
    if (shows_name(program_.registers[r].name)) registers.push_back(r);
  return registers;
}

bool ViewModel::shows_name(std::string_view name) const {
  return temporaries_shown || program::is_user_name(name);
}

std::optional<std::size_t> ViewModel::find_register(std::string_view name) const {
  return program::find_register(program_, name);
}

void ViewModel::select(std::size_t reg) {
  const program::Register& next = program_.registers[reg];
  const bool same_shape = selected_ && program_.registers[*selected_].width == next.width &&
                          program_.registers[*selected_].height == next.height;
  if (!same_shape) viewport = {};
  selected_ = reg;
  selected_by_user_ = true;
  if (tiled()) set_tiled(false);
}

std::vector<std::size_t> ViewModel::tiled_registers() const {
  std::vector<std::size_t> registers;
  for (const std::string& name : panel_state_.tiles)
    if (const auto reg = find_register(name)) registers.push_back(*reg);
  return registers;
}

bool ViewModel::tiled() const {
  return tiled_by_user_.value_or(panel_state_.tiled) && !panel_state_.tiles.empty();
}

const ViewModel::LockedTile* ViewModel::locked_tile(std::size_t reg) const {
  const auto found = locked_tiles_.find(reg);
  return found == locked_tiles_.end() ? nullptr : &found->second;
}

void ViewModel::toggle_tile_lock(std::size_t reg) {
  if (locked_tiles_.erase(reg) > 0) return;
  for (const debugger::SampledRegister& sample : snapshot_.tiles)
    if (sample.reg == reg) locked_tiles_[reg] = {sample, snapshot_.ticks};
}

RegisterStyle ViewModel::register_style(std::size_t reg) const { return styles_[reg]; }

void ViewModel::set_style(std::size_t reg, RegisterStyle style) {
  style.set_by_user = true;
  styles_[reg] = style;
}

debugger::ValueRange ViewModel::value_range(const RegisterStyle& style,
                                            const std::vector<float>& cells) const {
  if (style.palette == common::Palette::kRaw) return {0.0F, 255.0F};
  return style.auto_range ? debugger::automatic_range(cells) : style.range;
}

void ViewModel::set_surface_layout(const CellLayout& cells, std::uint32_t width, std::uint32_t height) {
  surface_layout_ = cells;
  surface_width_ = width;
  surface_height_ = height;
}

CellLayout ViewModel::cell_layout(std::size_t reg) const {
  const program::Register& r = program_.registers[reg];
  return r.width == surface_width_ && r.height == surface_height_ ? surface_layout_ : CellLayout();
}

CellLayout ViewModel::cell_layout(const debugger::SampledRegister& sample) const {
  return sample.stride == 1 ? cell_layout(sample.reg) : CellLayout();
}

std::optional<float> ViewModel::value_at(const debugger::Cell& at) const {
  if (!snapshot_.full || at.x >= snapshot_.full->width || at.y >= snapshot_.full->height) return std::nullopt;
  return snapshot_.full->cells[std::size_t{at.y} * snapshot_.full->width + at.x];
}

// ---- user actions -----------------------------------------------------------------------------------------

void ViewModel::run() {
  commands_.emplace_back([](debugger::DebugSession& s) { s.run(); });
}
void ViewModel::pause() {
  commands_.emplace_back([](debugger::DebugSession& s) { s.pause(); });
}
void ViewModel::toggle_running() {
  if (running())
    pause();
  else
    run();
}
void ViewModel::step(debugger::StepUnit unit) {
  follow_current_line = true;
  commands_.emplace_back([unit, rows = listing_.groups()](debugger::DebugSession& s) { s.step(unit, rows); });
}
void ViewModel::walk() {
  follow_current_line = true;
  const std::chrono::milliseconds period(1000 / std::max(steps_per_s, 1));
  const debugger::StepUnit unit = walk_by_tick ? debugger::StepUnit::kTick : debugger::StepUnit::kLine;
  commands_.emplace_back(
      [unit, period, rows = listing_.groups()](debugger::DebugSession& s) { s.walk(unit, period, rows); });
}
void ViewModel::press_key(int code) { panel_.press_key(code); }
void ViewModel::release_key(int code) { panel_.release_key(code); }
void ViewModel::release_all_keys() { panel_.release_all_keys(); }
void ViewModel::reset() {
  commands_.emplace_back([panel = &panel_](debugger::DebugSession& s) {
    panel->clear_program();
    s.reset();
  });
}

void ViewModel::probe_cell(const debugger::Cell& at) {
  probed_cell = at;
  commands_.emplace_back([at](debugger::DebugSession& s) { s.probe_cell(at); });
}

void ViewModel::set_profiling(bool on) {
  if (on == profiling_) return;
  profiling_ = on;
  commands_.emplace_back([on](debugger::DebugSession& s) { s.set_profiling(on); });
}

float ViewModel::parameter(const program::Parameter& parameter) const {
  return panel_.parameter(parameter.name).value_or(parameter.default_value);
}

void ViewModel::set_parameter(const program::Parameter& parameter, float value) {
  panel_.set_parameter(parameter.name, std::clamp(value, parameter.low, parameter.high));
}

// ---- breakpoints ------------------------------------------------------------------------------------------

std::vector<Breakpoint>::const_iterator ViewModel::find_breakpoint(const debugger::Listing::Row& row) const {
  return std::ranges::find_if(breakpoints_, [&](const Breakpoint& b) {
    return b.kind == Breakpoint::Kind::kLine && row.line == b.line && row.file == b.file;
  });
}

bool ViewModel::has_breakpoint(const debugger::Listing::Row& row) const {
  return find_breakpoint(row) != breakpoints_.end();
}

void ViewModel::toggle_breakpoint(std::size_t row) {
  if (row >= listing_.rows().size() || !listing_.rows()[row].has_code) return;
  const debugger::Listing::Row& clicked = listing_.rows()[row];
  if (const auto found = find_breakpoint(clicked); found != breakpoints_.end())
    breakpoints_.erase(found);
  else
    breakpoints_.push_back({.file = clicked.file, .line = clicked.line});
  send_breakpoints();
}

void ViewModel::add_tick_breakpoint(std::uint64_t tick) {
  breakpoints_.push_back({.kind = Breakpoint::Kind::kTick, .tick = tick});
  send_breakpoints();
}

std::string ViewModel::add_condition_breakpoint(const std::string& condition, bool on_change) {
  CompiledCondition compiled = compile_condition_(condition, program_);
  if (!compiled.program) return compiled.error;
  breakpoints_.push_back(
      {.kind = Breakpoint::Kind::kCondition, .condition = condition, .on_change = on_change});
  send_breakpoints();
  return {};
}

void ViewModel::set_breakpoint_enabled(std::size_t index, bool enabled) {
  breakpoints_[index].enabled = enabled;
  send_breakpoints();
}

void ViewModel::remove_breakpoint(std::size_t index) {
  breakpoints_.erase(breakpoints_.begin() + index);
  send_breakpoints();
}

// Removes condition breakpoints that no longer compile against a changed program.
void ViewModel::send_breakpoints() {
  std::vector<program::Program> condition_programs;
  for (auto breakpoint = breakpoints_.begin(); breakpoint != breakpoints_.end();) {
    if (breakpoint->kind == Breakpoint::Kind::kCondition) {
      CompiledCondition compiled = compile_condition_(breakpoint->condition, program_);
      if (!compiled.program) {
        notice = "The breakpoint '" + breakpoint->condition + "' was removed: " + compiled.error;
        breakpoint = breakpoints_.erase(breakpoint);
        continue;
      }
      condition_programs.push_back(std::move(*compiled.program));
    }
    ++breakpoint;
  }
  commands_.emplace_back([list = breakpoints_, questions = std::move(condition_programs)](
                             debugger::DebugSession& s) { s.set_breakpoints(list, questions); });
}

}  // namespace apron::ui
