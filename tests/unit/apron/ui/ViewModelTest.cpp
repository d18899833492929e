// The view model without drawing.
#include "apron/ui/ViewModel.h"

#include <gtest/gtest.h>

#include "tests/unit/apron/ui/UiFixture.h"

namespace apron::ui::test {
namespace {

TEST(Viewport, ZoomKeepsPointInPlace) {
  Viewport view;
  view.zoom_about(0.25F, 0.75F, 4.0F);
  EXPECT_FLOAT_EQ(view.zoom, 4.0F);
  // The point keeps its position in the view: a quarter from the west.
  EXPECT_NEAR((0.25F - (view.x - 0.5F / view.zoom)) * view.zoom, 0.25F, 1e-5);
  EXPECT_NEAR((0.75F - (view.y - 0.5F / view.zoom)) * view.zoom, 0.75F, 1e-5);
  view.pan(10.0F, -10.0F);
  EXPECT_FLOAT_EQ(view.x, 1.0F - 0.125F);
  EXPECT_FLOAT_EQ(view.y, 0.125F);
  view.zoom_about(0.5F, 0.5F, 0.01F);
  EXPECT_FLOAT_EQ(view.zoom, 1.0F);
  EXPECT_FLOAT_EQ(view.x, 0.5F);
}

TEST(ViewModel, ListsRegistersAndSelectsFirst) {
  UiFixture fixture("!register(A, B)\nA = 1\nB = max(A + 1, north(A) * 2) + A\n");
  EXPECT_EQ(fixture.model.listed_registers().size(), 2U);
  fixture.model.temporaries_shown = true;
  EXPECT_GT(fixture.model.listed_registers().size(), 2U);
  EXPECT_EQ(fixture.model.selected(), fixture.model.find_register("A"));
  EXPECT_FALSE(fixture.model.find_register("C"));
}

TEST(ViewModel, CommandsReachSession) {
  UiFixture fixture(debugger::test::kCounting);
  fixture.model.step(debugger::StepUnit::kTick);
  fixture.process_commands();
  EXPECT_EQ(fixture.model.snapshot().ticks, 1U);
  EXPECT_EQ(fixture.model.state_text(), "Paused at main.aps:9");
  fixture.model.toggle_running();
  fixture.process_commands();
  EXPECT_EQ(fixture.model.state_text(), "Running");
  fixture.model.toggle_running();
  fixture.process_commands();
  EXPECT_FALSE(fixture.model.running());
  fixture.model.step(debugger::StepUnit::kLine);
  fixture.process_commands();
  EXPECT_EQ(fixture.model.listing().rows()[fixture.model.current_row()].line, 5U);
  fixture.model.reset();
  fixture.process_commands();
  EXPECT_EQ(fixture.model.snapshot().ticks, 0U);
}

TEST(ViewModel, ReadsSelectedRegister) {
  UiFixture fixture(debugger::test::kCounting);
  fixture.model.step(debugger::StepUnit::kTick);
  fixture.process_commands();
  EXPECT_EQ(fixture.model.value_at({0, 0}), 100.0F);
  EXPECT_EQ(fixture.model.value_at({7, 5}), 1.0F);
  EXPECT_FALSE(fixture.model.value_at({8, 0}));
  EXPECT_EQ(fixture.model.statistics().max, 100.0F);
  RegisterStyle style = fixture.model.register_style(0);
  EXPECT_EQ(fixture.model.value_range(style, fixture.model.snapshot().full->cells).high, 100.0F);
  style.auto_range = false;
  style.range = {2.0F, 3.0F};
  fixture.model.set_style(0, style);
  EXPECT_EQ(fixture.model.value_range(fixture.model.register_style(0), {}).low, 2.0F);
}

TEST(ViewModel, FindsTextAndLineNumbersInListing) {
  UiFixture fixture("!register(A)\nA = 1\nB2 = 7\nA = A + B2\n");
  const ViewModel& model = fixture.model;
  EXPECT_EQ(model.find_row("b2", 0), 2U);
  EXPECT_EQ(model.find_row("b2", 3), 3U);
  EXPECT_EQ(model.find_row("b2", 4), 2U) << "continues from the top";
  EXPECT_EQ(model.find_row("4", 0), 3U) << "line 4";
  EXPECT_EQ(model.find_row("A = 1", 0), 1U);
  EXPECT_FALSE(model.find_row("C", 0));
  EXPECT_FALSE(model.find_row("99", 0));
  EXPECT_FALSE(model.find_row("", 0));
}

TEST(ViewModel, BreakpointsByLineTickAndCondition) {
  UiFixture fixture(debugger::test::kCounting);
  fixture.model.toggle_breakpoint(1);  // has no instructions
  EXPECT_TRUE(fixture.model.breakpoints().empty());
  fixture.model.toggle_breakpoint(5);
  EXPECT_TRUE(fixture.model.has_breakpoint(fixture.model.listing().rows()[5]));
  fixture.model.run();
  fixture.process_commands(5);
  EXPECT_EQ(fixture.model.state_text(), "Paused at the breakpoint main.aps:6");
  fixture.model.toggle_breakpoint(5);
  EXPECT_TRUE(fixture.model.breakpoints().empty());
  fixture.model.add_tick_breakpoint(3);
  EXPECT_NE(fixture.model.add_condition_breakpoint("globalsum(Nope) > 1"), "");
  EXPECT_EQ(fixture.model.add_condition_breakpoint("count > 5"), "");
  ASSERT_EQ(fixture.model.breakpoints().size(), 2U);
  fixture.model.run();
  fixture.process_commands(20);
  EXPECT_EQ(fixture.model.state_text(), "Paused: tick 3");
  fixture.model.run();
  fixture.process_commands(20);
  EXPECT_EQ(fixture.model.state_text(), "Paused: count > 5");
  EXPECT_EQ(fixture.model.snapshot().ticks, 5U);
  fixture.model.set_breakpoint_enabled(1, false);
  fixture.model.remove_breakpoint(0);
  fixture.model.run();
  fixture.process_commands(20);
  EXPECT_EQ(fixture.model.state_text(), "Running");
}

TEST(ViewModel, KeepsValidSettingsAcrossReload) {
  UiFixture fixture("!register(A, B)\nc = 1\nA = c\nB = A\n");
  fixture.model.select(1);
  RegisterStyle style;
  style.palette = common::Palette::kFlame;
  fixture.model.set_style(1, style);
  ASSERT_EQ(fixture.model.add_condition_breakpoint("c > 5"), "");
  ASSERT_EQ(fixture.model.add_condition_breakpoint("globalsum(B) > 5"), "");
  fixture.replace("!register(C, B)\nC = 1\nB = C\n");
  EXPECT_EQ(fixture.model.selected(), fixture.model.find_register("B"));
  EXPECT_EQ(fixture.model.register_style(1).palette, common::Palette::kFlame);
  ASSERT_EQ(fixture.model.breakpoints().size(), 1U);
  EXPECT_EQ(fixture.model.breakpoints()[0].condition, "globalsum(B) > 5");
  EXPECT_NE(fixture.model.notice.find("c > 5"), std::string::npos);
  // A snapshot from before the change is ignored.
  debugger::DebugSnapshot old;
  old.program_id = 1;
  old.ticks = 99;
  fixture.model.update(old);
  EXPECT_NE(fixture.model.snapshot().ticks, 99U);
}

TEST(ViewModel, FollowsProgramUntilUserSelects) {
  UiFixture fixture(
      "!register(A, B)\nreg.setPalette(B, 'magma')\nreg.setScale(B, 0, "
      "9)\nsim.show(B)\nsurface.step\nsim.show(A)\n"
      "surface.step\n");
  fixture.model.step(debugger::StepUnit::kTick);
  fixture.process_commands();
  EXPECT_EQ(fixture.model.selected(), std::size_t{1});
  EXPECT_EQ(fixture.model.register_style(1).palette, common::Palette::kMagma);
  EXPECT_FALSE(fixture.model.register_style(1).auto_range);
  fixture.model.select(1);
  fixture.model.step(debugger::StepUnit::kTick);
  fixture.process_commands();
  EXPECT_EQ(fixture.model.selected(), std::size_t{1}) << "the user's choice is kept";
}

TEST(ViewModel, TilesShownRegistersUntilUserSelects) {
  UiFixture fixture(
      "!register(A, B, C)\nsim.display(C)\nsim.show(B, 'b')\nsim.display(A)\nsim.show(B, 'b')\nsurface.step\n"
      "sim.show(C)\nsim.tile(2)\nsurface.step\nsim.tile(2)\nsurface.step\n");
  const auto tick = [&] {
    fixture.model.step(debugger::StepUnit::kTick);
    fixture.process_commands();
    fixture.process_commands();  // the second snapshot has the registers shown by the first
  };
  tick();
  EXPECT_FALSE(fixture.model.tiled());
  EXPECT_EQ(fixture.model.tiled_registers(), (std::vector<std::size_t>{2, 1, 0}));
  EXPECT_EQ(fixture.model.selected(), std::size_t{1}) << "sim.display does not enlarge the register";
  tick();
  EXPECT_TRUE(fixture.model.tiled());
  EXPECT_EQ(fixture.model.tile_columns(), 2);
  EXPECT_EQ(fixture.model.selected(), std::size_t{2});
  EXPECT_FALSE(fixture.model.snapshot_request().full);
  ASSERT_EQ(fixture.model.snapshot().tiles.size(), 3U);
  EXPECT_EQ(fixture.model.snapshot().tiles[0].reg, 2U);
  fixture.model.select(0);
  tick();
  EXPECT_FALSE(fixture.model.tiled()) << "the user's choice is kept";
  EXPECT_EQ(fixture.model.snapshot().full->reg, 0U);
  fixture.model.set_tiled(true);
  EXPECT_TRUE(fixture.model.tiled());
}

TEST(ViewModel, LockedTileKeepsTheCellsOfItsTick) {
  UiFixture fixture(
      "!register(A)\nsim.display(A, 'a')\nsim.tile\nwhile(1)\nA = A + 1\nsurface.step\nendwhile\n");
  ViewModel& model = fixture.model;
  model.run();
  fixture.process_commands(3);
  fixture.process_commands(0);  // now with the tiles
  const std::size_t reg = *model.find_register("A");
  EXPECT_EQ(model.locked_tile(reg), nullptr);
  model.toggle_tile_lock(reg);
  fixture.process_commands(2);
  ASSERT_NE(model.locked_tile(reg), nullptr);
  EXPECT_EQ(model.locked_tile(reg)->tick, 3U);
  EXPECT_EQ(model.locked_tile(reg)->sample.cells.front(), 3.0F);
  EXPECT_EQ(model.snapshot().tiles.at(0).cells.front(), 5.0F);
  model.toggle_tile_lock(reg);
  EXPECT_EQ(model.locked_tile(reg), nullptr);
}

TEST(PaneLayout, RoundTripsAndIgnoresWhatItDoesNotKnow) {
  PaneLayout layout;
  layout.wide.program = 420.0F;
  layout.narrow.values = 180.0F;
  EXPECT_EQ(format_layout(layout), "wide.program 420\nnarrow.values 180\n");
  EXPECT_EQ(parse_layout(format_layout(layout)), layout);
  EXPECT_EQ(parse_layout("wide.program -3\nwide.other 7\nwide.bottom nan\nnarrow.values 1e9\n\n?"),
            PaneLayout());
}

TEST(ProgramEditor, KeepsUnsavedChangesAndFollowsTheDisk) {
  ProgramEditor editor;
  editor.set_sources(
      {{"main.aps", "one\n", {}, 0}, {"part.aps", "two\n", 0, 1}, {"part.aps", "two\n", 0, 2}});
  ASSERT_EQ(editor.files().size(), 2U) << "a file included twice is one file";
  editor.open("part.aps", 3, 2);
  EXPECT_TRUE(editor.shown);
  EXPECT_EQ(editor.take_position()->line, 3U);
  EXPECT_FALSE(editor.take_position());
  editor.current()->text = "mine\n";
  editor.set_sources({{"main.aps", "ONE\n", {}, 0}, {"part.aps", "TWO\n", 0, 1}});
  EXPECT_EQ(editor.current()->name, "part.aps");
  EXPECT_EQ(editor.current()->text, "mine\n") << "unsaved";
  EXPECT_EQ(editor.files().front().text, "ONE\n");
  EXPECT_EQ(editor.files().front().revision, 1U);
  editor.request_save();
  const auto request = editor.take_save_request();
  ASSERT_TRUE(request);
  EXPECT_EQ(request->old_text, "TWO\n");
  editor.mark_conflict(*request, "three\n");
  editor.request_save();
  EXPECT_EQ(editor.take_save_request()->old_text, "three\n") << "the second request replaces it";
  editor.revert();
  EXPECT_EQ(editor.current()->text, "three\n");
  editor.set_text_on_disk("part.aps", "four\n");
  EXPECT_EQ(editor.current()->text, "four\n");
}

}  // namespace
}  // namespace apron::ui::test
