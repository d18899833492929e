// The state of the window and the user's requests, independent of drawing.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apron/debugger/ColorMap.h"
#include "apron/debugger/DebugSession.h"
#include "apron/debugger/DebugSnapshot.h"
#include "apron/debugger/FrontPanel.h"
#include "apron/debugger/Listing.h"
#include "apron/debugger/Statistics.h"
#include "apron/ui/CellLayout.h"
#include "apron/ui/PaneLayout.h"
#include "apron/ui/ProgramEditor.h"
#include "common/color/Palette.h"

namespace apron::ui {

// How a register is coloured.
struct RegisterStyle {
  common::Palette palette = common::Palette::kGrey;
  bool auto_range = true;      // derive the range from the cells
  debugger::ValueRange range;  // used if auto_range is false

  bool set_by_user = false;  // overrides what the program requests
};

// The visible part of the large register. Coordinates are fractions of the register's width and height, from
// the north-west corner.
struct Viewport {
  float x = 0.5F, y = 0.5F;  // centre
  float zoom = 1.0F;         // 1: the whole register is visible

  // Zooms by `factor`, keeping the point (at_x, at_y) in place on the screen.
  void zoom_about(float at_x, float at_y, float factor);
  void pan(float dx, float dy);
};

class ViewModel {
 public:
  using SessionCommand = std::function<void(debugger::DebugSession&)>;
  struct CompiledCondition {
    std::optional<program::Program> program;
    std::string error;  // one line; empty if there is a program
  };
  // Compiles a condition against the symbols of a program.
  using ConditionCompiler =
      std::function<CompiledCondition(const std::string& condition, const program::Program&)>;

  // panel must outlive this.
  ViewModel(debugger::FrontPanel& panel, ConditionCompiler compile_condition);

  // ---- program ----
  // Shows a new or changed program. program_id: as in DebugSnapshot; snapshots of other programs are ignored.
  // Keeps selection, user styles and breakpoints where register names persist and conditions still compile.
  void show_program(program::Program program, const std::vector<debugger::SourceText>& texts,
                    std::uint64_t program_id);
  void update(debugger::DebugSnapshot snapshot);
  debugger::SnapshotRequest snapshot_request() const;

  const program::Program& program() const { return program_; }
  const debugger::DebugSnapshot& snapshot() const { return snapshot_; }
  // Incremented by each new snapshot; textures of older snapshots are out of date.
  std::uint64_t snapshot_serial() const { return snapshot_serial_; }
  const debugger::FrontPanel::State& panel() const { return panel_state_; }
  debugger::Listing& listing() { return listing_; }
  // The listing's row of the next instruction.
  std::size_t current_row() const;
  // The first row at or after `from`, then from the top, that contains the text in any case, or, if the query
  // is a number, shows that line of the main file. Only rows that no fold hides.
  std::optional<std::size_t> find_row(std::string_view query, std::size_t from) const;
  // "Running", "Paused at main.aps:12", …
  std::string state_text() const;
  bool running() const;
  bool finished() const { return snapshot_.mode == debugger::ExecutionState::kFinished; }
  double ticks_per_s() const { return ticks_per_s_; }

  // ---- registers ----
  // Registers in the program's order; compiler temporaries only if temporaries_shown.
  std::vector<std::size_t> listed_registers() const;
  // False for the names that the compiler and macros create, unless temporaries_shown.
  bool shows_name(std::string_view name) const;
  // nullopt if the name is unknown.
  std::optional<std::size_t> find_register(std::string_view name) const;
  void select(std::size_t reg);
  const std::optional<std::size_t>& selected() const { return selected_; }
  RegisterStyle register_style(std::size_t reg) const;
  void set_style(std::size_t reg, RegisterStyle style);
  debugger::ValueRange value_range(const RegisterStyle& style, const std::vector<float>& cells) const;
  // The statistics of the selected register.
  const debugger::Statistics& statistics() const { return statistics_; }
  // The surface's layout, in which registers of that size are drawn.
  void set_surface_layout(const CellLayout& cells, std::uint32_t width, std::uint32_t height);
  CellLayout cell_layout(std::size_t reg) const;
  // Squares for a subsampled register, whose rows are not those of the surface.
  CellLayout cell_layout(const debugger::SampledRegister& sample) const;
  std::optional<float> value_at(const debugger::Cell& cell) const;  // nullopt outside the selected register
  // Registers that the program shows, in order of appearance.
  std::vector<std::size_t> tiled_registers() const;
  // True if tiles replace the large register. The program decides until the user does.
  bool tiled() const;
  void set_tiled(bool on) { tiled_by_user_ = on; }
  int tile_columns() const { return panel_state_.tile_columns; }  // 0: automatic
  // A locked tile keeps the register's cells of one tick.
  struct LockedTile {
    debugger::SampledRegister sample;
    std::uint64_t tick = 0;
  };
  // nullptr if the tile is not locked.
  const LockedTile* locked_tile(std::size_t reg) const;
  // Locks the tile with what it shows, or unlocks it. A tile that shows nothing yet stays unlocked.
  void toggle_tile_lock(std::size_t reg);

  // ---- user actions ----
  void run();
  void pause();
  void toggle_running();
  void step(debugger::StepUnit unit);
  void walk();
  void reset();
  // True if the running program reads keys, which then go to it. Codes are those of program/Keys.h.
  bool takes_keys() const { return reads_keys_ && running(); }
  void press_key(int code);
  void release_key(int code);
  void release_all_keys();
  void probe_cell(const debugger::Cell& cell);
  void set_profiling(bool on);
  void set_parameter(const program::Parameter& parameter, float value);
  float parameter(const program::Parameter& parameter) const;
  const std::vector<debugger::Breakpoint>& breakpoints() const { return breakpoints_; }
  // Adds or removes the breakpoint on a listing row; ignores rows without instructions.
  void toggle_breakpoint(std::size_t row);
  bool has_breakpoint(const debugger::Listing::Row& row) const;
  void add_tick_breakpoint(std::uint64_t tick);
  // Returns the compiler's error message, or empty.
  std::string add_condition_breakpoint(const std::string& condition, bool on_change = false);
  void set_breakpoint_enabled(std::size_t index, bool enabled);
  void remove_breakpoint(std::size_t index);

  // Returns and clears the pending commands, to be executed on the session in order.
  std::vector<SessionCommand> take_commands() { return std::exchange(commands_, {}); }
  // Returns and clears reload_requested.
  bool take_reload_request() { return std::exchange(reload_requested, false); }

  // ---- window state ----
  PaneLayout layout;
  ProgramEditor editor;
  Viewport viewport;
  debugger::Cell probed_cell;
  std::optional<std::size_t> enlarged_history;  // of a register, at the size of the panel
  bool probe_shown = false, profile_shown = false, temporaries_shown = false, help_shown = false,
       reload_requested = false, emergency_stop_requested = false;
  bool follow_current_line = true;     // scroll the listing to the current line
  bool speed_shown = true;             // measure and show ticks per second
  int steps_per_s = 4;                 // walking speed
  bool walk_by_tick = false;           // else by line
  std::array<char, 64> search_text{};  // of the search in the listing, zero-terminated
  std::optional<std::size_t> found_row;
  bool focus_search = false, scroll_to_found = false;
  std::string notice;  // one line shown in red, such as an error in a reloaded program
  std::vector<std::size_t> visible_thumbnails;  // registers whose thumbnails are scrolled into view

 private:
  std::vector<debugger::Breakpoint>::const_iterator find_breakpoint(const debugger::Listing::Row& row) const;
  void send_breakpoints();
  void apply_appearances();
  void measure_speed();

  CellLayout surface_layout_;
  std::uint32_t surface_width_ = 0, surface_height_ = 0;
  debugger::FrontPanel& panel_;
  ConditionCompiler compile_condition_;
  program::Program program_;
  std::uint64_t program_id_ = 0, snapshot_serial_ = 0;
  debugger::Listing listing_;
  debugger::DebugSnapshot snapshot_;
  debugger::Statistics statistics_;
  bool reads_keys_ = false;
  debugger::FrontPanel::State panel_state_;
  std::uint64_t panel_revision_ = 0;
  std::optional<std::size_t> selected_;
  bool selected_by_user_ = false;
  std::optional<bool> tiled_by_user_;
  std::map<std::size_t, LockedTile> locked_tiles_;  // keyed by register
  std::vector<RegisterStyle> styles_;               // indexed by register
  std::vector<debugger::Breakpoint> breakpoints_;
  std::vector<SessionCommand> commands_;
  bool profiling_ = false;
  double ticks_per_s_ = 0.0;
  std::uint64_t measured_ticks_ = 0;
  std::chrono::steady_clock::time_point measured_at_{};
};

}  // namespace apron::ui
