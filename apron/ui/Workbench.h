// What the window shows and what the person before it wants, without any drawing.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "apron/debugger/FrontPanel.h"
#include "apron/debugger/Listing.h"
#include "apron/debugger/Look.h"
#include "apron/debugger/Palette.h"
#include "apron/debugger/Session.h"
#include "apron/debugger/Statistics.h"

namespace apron::ui {

// How a register is coloured.
struct Style {
  debugger::PaletteId palette = debugger::PaletteId::kGrey;
  bool automatic = true;  // the range is found out from the cells
  debugger::Range range;  // otherwise

  bool by_person = false;  // what the program asks for no longer counts
};

// Where in the large register the person looks: a cell at the view's middle, and how much larger than
// fitting.
struct Viewpoint {
  float x = 0.5F, y = 0.5F;  // of the register's width and height
  float zoom = 1.0F;         // 1: all of it is seen

  // Zooms by `factor` about a point that stays where it is; at: of the register's width and height.
  void zoom_about(float at_x, float at_y, float factor);
  void pan(float dx, float dy);
};

class Workbench {
 public:
  using Order = std::function<void(debugger::Session&)>;
  struct Question {
    std::optional<program::Program> program;
    std::string wrong;  // one line; "" if there is a program
  };
  // Compiles a condition against the program shown.
  using Ask = std::function<Question(const std::string& condition, const program::Program&)>;

  // The panel must outlive it.
  Workbench(debugger::FrontPanel& panel, Ask ask);

  // ---- from the program ----
  // number: that of Look::program. Selection, styles, folds and breakpoints stay as far as the names do.
  void show_program(program::Program program, const std::vector<debugger::SourceText>& texts,
                    std::uint64_t number);
  void update(debugger::Look look);
  debugger::LookRequest request() const;

  const program::Program& program() const { return program_; }
  const debugger::Look& look() const { return look_; }
  // Counts the looks: what is drawn of an older one is out of date.
  std::uint64_t serial() const { return serial_; }
  const debugger::FrontPanel::State& panel() const { return panel_state_; }
  debugger::Listing& listing() { return listing_; }
  std::size_t current_row() const;
  // "Running", "Held at line 12", …
  std::string state() const;
  bool running() const;
  bool over() const { return look_.mode == debugger::Mode::kOver; }
  double ticks_per_s() const { return ticks_per_s_; }

  // ---- registers ----
  // Those shown in the list, in the program's order; temporaries only if wanted.
  std::vector<std::size_t> listed() const;
  // By name; nothing if there is none of that name.
  std::optional<std::size_t> find_register(std::string_view name) const;
  void select(std::size_t reg);
  const std::optional<std::size_t>& selected() const { return selected_; }
  Style style(std::size_t reg) const;
  void set_style(std::size_t reg, Style style);
  debugger::Range range(const Style& style, const std::vector<float>& cells) const;
  // Of the large register's cells.
  const debugger::Statistics& statistics() const { return statistics_; }
  std::optional<float> value(const debugger::Cell& cell) const;  // in the large register
  // Registers that the program shows, in order of appearance, and whether they stand side by side in place of
  // the large one: as the program wants it, until the person chooses.
  std::vector<std::size_t> tiles() const;
  bool tiled() const;
  void set_tiled(bool on) { tiled_by_person_ = on; }
  int tile_columns() const { return panel_state_.tile_columns; }  // 0: as fits

  // ---- what the person does ----
  void run();
  void hold();
  void toggle();
  void step(debugger::Unit unit);
  void walk();
  void reset();
  void watch(const debugger::Cell& cell);
  void set_profiling(bool on);
  void set_parameter(const program::Parameter& parameter, float value);
  float parameter(const program::Parameter& parameter) const;
  const std::vector<debugger::Breakpoint>& breakpoints() const { return breakpoints_; }
  // Sets or takes back the breakpoint of a listing's row.
  void toggle_breakpoint(std::size_t row);
  bool has_breakpoint(const debugger::Listing::Row& row) const;
  void add_tick_breakpoint(std::uint64_t tick);
  // "" or what is wrong with the condition.
  std::string add_condition(const std::string& condition);
  void switch_breakpoint(std::size_t number, bool on);
  void remove_breakpoint(std::size_t number);

  // What is to be done with the session, since the last call.
  std::vector<Order> take_orders() { return std::exchange(orders_, {}); }
  bool take_reload() { return std::exchange(reload, false); }

  // ---- the window's own state ----
  Viewpoint view;
  debugger::Cell cell;  // watched
  bool cell_shown = false, profile_shown = false, temporaries_shown = false, help_shown = false,
       reload = false;
  bool follow = true;                      // scroll to the current line
  bool clocked = true;                     // how fast it runs is shown
  int lines_per_s = 4;                     // of a walk
  std::string notice;                      // one line in red, such as what is wrong with a changed program
  std::vector<std::size_t> small_visible;  // registers whose thumbnails are in sight

 private:
  void send_breakpoints();
  void take_appearances();
  void measure_speed();

  debugger::FrontPanel& panel_;
  Ask ask_;
  program::Program program_;
  std::uint64_t number_ = 0, serial_ = 0;
  debugger::Listing listing_;
  debugger::Look look_;
  debugger::Statistics statistics_;
  debugger::FrontPanel::State panel_state_;
  std::uint64_t panel_revision_ = 0;
  std::optional<std::size_t> selected_;
  bool selected_by_person_ = false;
  std::optional<bool> tiled_by_person_;
  std::vector<Style> styles_;  // by register
  std::vector<debugger::Breakpoint> breakpoints_;
  std::vector<Order> orders_;
  bool profiling_ = false;
  double ticks_per_s_ = 0.0;
  std::uint64_t measured_ticks_ = 0;
  std::chrono::steady_clock::time_point measured_at_{};
};

}  // namespace apron::ui
