// What the window knows, without drawing it.
#include "apron/ui/Workbench.h"

#include <gtest/gtest.h>

#include "tests/unit/apron/ui/Desk.h"

namespace apron::ui::test {
namespace {

TEST(Viewpoint, ZoomsAboutAPointThatStays) {
  Viewpoint view;
  view.zoom_about(0.25F, 0.75F, 4.0F);
  EXPECT_FLOAT_EQ(view.zoom, 4.0F);
  // The point was a quarter of the view from the west; it still is.
  EXPECT_NEAR((0.25F - (view.x - 0.5F / view.zoom)) * view.zoom, 0.25F, 1e-5);
  EXPECT_NEAR((0.75F - (view.y - 0.5F / view.zoom)) * view.zoom, 0.75F, 1e-5);
  view.pan(10.0F, -10.0F);
  EXPECT_FLOAT_EQ(view.x, 1.0F - 0.125F);
  EXPECT_FLOAT_EQ(view.y, 0.125F);
  view.zoom_about(0.5F, 0.5F, 0.01F);
  EXPECT_FLOAT_EQ(view.zoom, 1.0F);
  EXPECT_FLOAT_EQ(view.x, 0.5F);
}

TEST(Workbench, ListsRegistersAndSelectsTheFirst) {
  Desk desk("!register(A, B)\nA = 1\nB = max(A + 1, north(A) * 2) + A\n");
  EXPECT_EQ(desk.bench.listed().size(), 2U);
  desk.bench.temporaries_shown = true;
  EXPECT_GT(desk.bench.listed().size(), 2U);
  EXPECT_EQ(desk.bench.selected(), desk.bench.find_register("A"));
  EXPECT_FALSE(desk.bench.find_register("C"));
}

TEST(Workbench, OrdersReachTheSession) {
  Desk desk(debugger::test::kCounting);
  desk.bench.step(debugger::Unit::kTick);
  desk.obey();
  EXPECT_EQ(desk.bench.look().ticks, 1U);
  EXPECT_EQ(desk.bench.state(), "Held at main.aps:9");
  desk.bench.toggle();
  desk.obey();
  EXPECT_EQ(desk.bench.state(), "Running");
  desk.bench.toggle();
  desk.obey();
  EXPECT_FALSE(desk.bench.running());
  desk.bench.step(debugger::Unit::kLine);
  desk.obey();
  EXPECT_EQ(desk.bench.listing().rows()[desk.bench.current_row()].line, 5U);
  desk.bench.reset();
  desk.obey();
  EXPECT_EQ(desk.bench.look().ticks, 0U);
}

TEST(Workbench, ReadsTheSelectedRegister) {
  Desk desk(debugger::test::kCounting);
  desk.bench.step(debugger::Unit::kTick);
  desk.obey();
  EXPECT_EQ(desk.bench.value({0, 0}), 100.0F);
  EXPECT_EQ(desk.bench.value({7, 5}), 1.0F);
  EXPECT_FALSE(desk.bench.value({8, 0}));
  EXPECT_EQ(desk.bench.statistics().max, 100.0F);
  Style style = desk.bench.style(0);
  EXPECT_EQ(desk.bench.range(style, desk.bench.look().large->cells).high, 100.0F);
  style.automatic = false;
  style.range = {2.0F, 3.0F};
  desk.bench.set_style(0, style);
  EXPECT_EQ(desk.bench.range(desk.bench.style(0), {}).low, 2.0F);
}

TEST(Workbench, BreakpointsByLineTickAndCondition) {
  Desk desk(debugger::test::kCounting);
  desk.bench.toggle_breakpoint(1);  // has no instructions
  EXPECT_TRUE(desk.bench.breakpoints().empty());
  desk.bench.toggle_breakpoint(5);
  EXPECT_TRUE(desk.bench.has_breakpoint(desk.bench.listing().rows()[5]));
  desk.bench.run();
  desk.obey(5);
  EXPECT_EQ(desk.bench.state(), "Held at the breakpoint main.aps:6");
  desk.bench.toggle_breakpoint(5);
  EXPECT_TRUE(desk.bench.breakpoints().empty());
  desk.bench.add_tick_breakpoint(3);
  EXPECT_NE(desk.bench.add_condition("globalsum(Nope) > 1"), "");
  EXPECT_EQ(desk.bench.add_condition("count > 5"), "");
  ASSERT_EQ(desk.bench.breakpoints().size(), 2U);
  desk.bench.run();
  desk.obey(20);
  EXPECT_EQ(desk.bench.state(), "Held: tick 3");
  desk.bench.run();
  desk.obey(20);
  EXPECT_EQ(desk.bench.state(), "Held: count > 5");
  EXPECT_EQ(desk.bench.look().ticks, 5U);
  desk.bench.switch_breakpoint(1, false);
  desk.bench.remove_breakpoint(0);
  desk.bench.run();
  desk.obey(20);
  EXPECT_EQ(desk.bench.state(), "Running");
}

TEST(Workbench, KeepsWhatItCanWhenTheProgramChanges) {
  Desk desk("!register(A, B)\nc = 1\nA = c\nB = A\n");
  desk.bench.select(1);
  Style style;
  style.palette = debugger::PaletteId::kFlame;
  desk.bench.set_style(1, style);
  ASSERT_EQ(desk.bench.add_condition("c > 5"), "");
  ASSERT_EQ(desk.bench.add_condition("globalsum(B) > 5"), "");
  desk.replace("!register(C, B)\nC = 1\nB = C\n");
  EXPECT_EQ(desk.bench.selected(), desk.bench.find_register("B"));
  EXPECT_EQ(desk.bench.style(1).palette, debugger::PaletteId::kFlame);
  ASSERT_EQ(desk.bench.breakpoints().size(), 1U);
  EXPECT_EQ(desk.bench.breakpoints()[0].condition, "globalsum(B) > 5");
  EXPECT_NE(desk.bench.notice.find("c > 5"), std::string::npos);
  // A look from before the change is not taken.
  debugger::Look old;
  old.program = 1;
  old.ticks = 99;
  desk.bench.update(old);
  EXPECT_NE(desk.bench.look().ticks, 99U);
}

TEST(Workbench, ShowsWhatTheScriptWantsUntilThePersonChooses) {
  Desk desk(
      "!register(A, B)\nreg.setPalette(B, 'magma')\nreg.setScale(B, 0, "
      "9)\nsim.show(B)\nsurface.step\nsim.show(A)\n"
      "surface.step\n");
  desk.bench.step(debugger::Unit::kTick);
  desk.obey();
  EXPECT_EQ(desk.bench.selected(), std::size_t{1});
  EXPECT_EQ(desk.bench.style(1).palette, debugger::PaletteId::kMagma);
  EXPECT_FALSE(desk.bench.style(1).automatic);
  desk.bench.select(1);
  desk.bench.step(debugger::Unit::kTick);
  desk.obey();
  EXPECT_EQ(desk.bench.selected(), std::size_t{1}) << "the person's choice stands";
}

TEST(Workbench, TilesWhatTheScriptShowsUntilThePersonChooses) {
  Desk desk(
      "!register(A, B, C)\nsim.display(C)\nsim.show(B, 'b')\nsim.display(A)\nsim.show(B, 'b')\nsurface.step\n"
      "sim.show(C)\nsim.tile(2)\nsurface.step\nsim.tile(2)\nsurface.step\n");
  const auto tick = [&] {
    desk.bench.step(debugger::Unit::kTick);
    desk.obey();
    desk.obey();  // what is to be seen comes with the next look
  };
  tick();
  EXPECT_FALSE(desk.bench.tiled());
  EXPECT_EQ(desk.bench.tiles(), (std::vector<std::size_t>{2, 1, 0}));
  EXPECT_EQ(desk.bench.selected(), std::size_t{1}) << "sim.display does not make it the large one";
  tick();
  EXPECT_TRUE(desk.bench.tiled());
  EXPECT_EQ(desk.bench.tile_columns(), 2);
  EXPECT_EQ(desk.bench.selected(), std::size_t{2});
  EXPECT_FALSE(desk.bench.request().large);
  ASSERT_EQ(desk.bench.look().tiles.size(), 3U);
  EXPECT_EQ(desk.bench.look().tiles[0].reg, 2U);
  desk.bench.select(0);
  tick();
  EXPECT_FALSE(desk.bench.tiled()) << "the person's choice stands";
  EXPECT_EQ(desk.bench.look().large->reg, 0U);
  desk.bench.set_tiled(true);
  EXPECT_TRUE(desk.bench.tiled());
}

}  // namespace
}  // namespace apron::ui::test
