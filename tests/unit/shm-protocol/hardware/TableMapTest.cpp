// Boards in a table: random tables against places computed from coordinates, vectors, and mistakes.
#include "shm-protocol/hardware/bridge/TableMap.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <set>

namespace hardware {
namespace {

DeviceDescription board_of(std::uint32_t rows, std::uint32_t columns, const std::string& id = "") {
  DeviceDescription d;
  d.name = "test";
  d.rows = rows;
  d.columns = columns;
  d.period_us = 1000;
  d.version = 2;
  d.id = id;
  const std::size_t cells = std::size_t{rows} * columns;
  d.channels.push_back({"slip", "", true, SSW_F32, 3, -9, 9, 0, 1, 0, 3 * cells, 0, {}, SSW_VECTOR});
  d.channels.push_back(
      {"tilt", "", true, SSW_F32, 2, -9, 9, 0, 1, 0, 2 * cells, 3 * cells, {}, SSW_AXIAL_VECTOR});
  d.channels.push_back({"force", "", false, SSW_F32, 2, -9, 9, 0, 1, 0, 2 * cells, 0, {}, SSW_VECTOR});
  return d;
}

TableBoard at(std::uint32_t row, std::uint32_t column, int turn = 0, bool mirror = false) {
  TableBoard board;
  board.port.text = "line" + std::to_string(row) + "-" + std::to_string(column);
  board.row = row;
  board.column = column;
  board.turn = turn;
  board.mirror = mirror;
  return board;
}

TableSpec table_of(std::vector<TableBoard> boards, bool holes = false) {
  TableSpec spec;
  spec.file = "t.toml";
  spec.name = "t";
  spec.period_us = 1000;
  spec.holes = holes;
  spec.boards = std::move(boards);
  for (std::size_t i = 0; i < spec.boards.size(); ++i) spec.boards[i].line = 10 * (i + 1);
  return spec;
}

std::string error_of(const TableSpec& spec, const std::vector<DeviceDescription>& boards) {
  try {
    TableMap map(spec);
    for (std::size_t i = 0; i < boards.size(); ++i) map.mount(i, boards[i]);
    map.freeze();
  } catch (const std::invalid_argument& e) {
    return e.what();
  }
  return "none";
}

struct Point {
  double x, y;  // east, north
};

// A board's own direction in the table, by rotation of the plane.
Point to_table(const TableBoard& b, Point p) {
  if (b.mirror) p.x = -p.x;
  const double angle = b.turn * M_PI / 180;
  return {std::cos(angle) * p.x - std::sin(angle) * p.y, std::sin(angle) * p.x + std::cos(angle) * p.y};
}

// Boards in a row, turned and mirrored at random: each cell of the table belongs to the cell of a board that
// lies there by geometry, and vectors point the same way in the plane.
TEST(TableMap, CellsAndVectorsFollowTheGeometry) {
  std::mt19937 random(5);
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<TableBoard> boards;
    std::vector<DeviceDescription> devices;
    std::uint32_t column = 0;
    for (int i = 0; i < 4; ++i) {
      const std::uint32_t rows = 1 + random() % 5, columns = 1 + random() % 5;
      const int turn = 90 * static_cast<int>(random() % 4);
      boards.push_back(at(random() % 3, column, turn, random() % 2));
      devices.push_back(board_of(rows, columns));
      column += turn % 180 ? rows : columns;
    }
    const TableSpec spec = table_of(boards, true);
    TableMap map(spec);
    for (std::size_t i = 0; i < devices.size(); ++i) map.mount(i, devices[i]);
    map.freeze();
    std::set<std::uint32_t> taken;
    for (std::size_t i = 0; i < devices.size(); ++i) {
      const MountedBoard& m = map.boards()[i];
      const DeviceDescription& d = devices[i];
      const Point middle{m.column + 0.5 * m.columns, -(m.row + 0.5 * m.rows)};
      for (std::uint32_t cell = 0; cell < m.cells.size(); ++cell) {
        const Point own{cell % d.columns + 0.5 - 0.5 * d.columns, 0.5 * d.rows - 0.5 - cell / d.columns};
        const Point turned = to_table(boards[i], own);
        const auto row = static_cast<std::uint32_t>(std::lround(-(middle.y + turned.y) - 0.5));
        const auto col = static_cast<std::uint32_t>(std::lround(middle.x + turned.x - 0.5));
        ASSERT_EQ(m.cells[cell], row * map.columns() + col) << "turn " << boards[i].turn << boards[i].mirror;
        ASSERT_TRUE(taken.insert(m.cells[cell]).second);
      }
      const std::size_t cells = m.cells.size(), all = std::size_t{map.rows()} * map.columns();
      std::vector<float> own(3 * cells), table(3 * all), back(3 * cells);
      for (float& v : own) v = static_cast<float>(static_cast<int>(random() % 19) - 9);
      copy_to_table(m, m.channels[0], 3, own.data(), table.data(), all);
      for (std::size_t cell = 0; cell < cells; ++cell) {
        const Point p = to_table(boards[i], {own[cell], own[cells + cell]});
        EXPECT_NEAR(table[m.cells[cell]], p.x, 1e-6);
        EXPECT_NEAR(table[all + m.cells[cell]], p.y, 1e-6);
        EXPECT_EQ(table[2 * all + m.cells[cell]], own[2 * cells + cell]);
      }
      copy_to_board(m, m.channels[0], 3, table.data(), all, back.data());
      EXPECT_EQ(back, own);
      // A roll about the axis a turns b into a × b: axial vectors keep this when both are turned and
      // mirrored.
      copy_to_table(m, m.channels[1], 2, own.data(), table.data(), all);
      for (std::size_t cell = 0; cell < cells; ++cell) {
        const Point axis{own[cell], own[cells + cell]},
            axis_there{table[m.cells[cell]], table[all + m.cells[cell]]};
        const Point b{0.25, -0.5}, b_there = to_table(boards[i], b);
        EXPECT_NEAR(axis.x * b.y - axis.y * b.x, axis_there.x * b_there.y - axis_there.y * b_there.x, 1e-6);
      }
      const BoardChannel& force = m.channels[2];
      EXPECT_EQ(map.channels()[force.table_channel].name, "force");
    }
  }
}

// PROTOCOL.md: x = column · pitch, y = (rows − 1 − row) · pitch.
TEST(TableMap, CellsOfAGridLieWhereThoseWithoutPositionsDo) {
  const TableSpec spec = table_of({at(0, 0), at(2, 0)});
  TableMap map(spec);
  DeviceDescription raised = board_of(2, 3);
  raised.pitch = 2.0F;
  DeviceDescription level = raised;
  for (std::uint32_t cell = 0; cell < 6; ++cell)  // from its own north-west cell
    raised.positions.push_back(
        {2.0F * static_cast<float>(cell % 3), -2.0F * static_cast<float>(cell / 3), 0.5F});
  map.mount(0, raised);
  map.mount(1, level);
  map.freeze();
  const auto positions = map.positions();
  ASSERT_EQ(positions.size(), 12U);
  for (std::uint32_t cell = 0; cell < 12; ++cell) {
    const float x = 2.0F * static_cast<float>(cell % 3), y = 2.0F * (3.0F - static_cast<float>(cell / 3));
    EXPECT_EQ(positions[cell], (std::array<float, 3>{x, y, cell < 6 ? 0.5F : 0.0F})) << cell;
  }
}

TEST(TableMap, MistakesNameFileLineAndBoards) {
  const auto d = board_of(2, 3);
  EXPECT_EQ(error_of(table_of({at(0, 0), at(1, 2)}, true), {d, d}),
            "t.toml:20: board 'line1-2': overlaps board 'line0-0' of line 10 at row 1, column 2");
  EXPECT_TRUE(error_of(table_of({at(0, 0), at(0, 4)}), {d, d})
                  .starts_with("t.toml:20: board 'line0-4': no board covers row 0, column 3"));
  EXPECT_EQ(error_of(table_of({at(0, 0), at(0, 4)}, true), {d, d}), "none");
  // A wrong turn shows as an overlap or as a hole.
  EXPECT_EQ(error_of(table_of({at(0, 0), at(0, 3)}), {d, d}), "none");
  EXPECT_NE(error_of(table_of({at(0, 0, 90), at(0, 3)}), {d, d}), "none");
  auto other = d;
  other.channels[0].unit = "N";
  EXPECT_EQ(error_of(table_of({at(0, 0), at(0, 3)}), {d, other}),
            "t.toml:20: board 'line0-3': the sensor 'slip' has unit 'N' and 3 components; that of other "
            "boards has '' and "
            "3");
  auto named = table_of({at(0, 0)});
  named.boards[0].id = "b7";
  EXPECT_EQ(error_of(named, {board_of(2, 3, "b8")}), "t.toml:10: board 'b7': the device is board 'b8'");
  auto slow = d;
  slow.period_us = 2000;
  EXPECT_NE(error_of(table_of({at(0, 0)}), {slow}).find("control period is 2000"), std::string::npos);
  EXPECT_NE(error_of(table_of({at(0, 0)}), {}).find("is not there, and has no size"), std::string::npos);
  auto absent = table_of({at(0, 0), at(0, 3)});
  absent.boards[1].size = {2, 3};
  EXPECT_EQ(error_of(absent, {d}), "none");
  absent.boards[1].size = {65535, 65533};  // refused before its cells take memory
  EXPECT_EQ(error_of(absent, {d}), "t.toml: a table of 65535 rows of 65536 cells is too large");
  auto reserved = d;
  reserved.channels[0].name = "valid";
  EXPECT_NE(error_of(table_of({at(0, 0)}), {reserved}).find("one of the table's own"), std::string::npos);
}

TEST(TableMap, BoardsMayDifferInChannelsAndMaskCells) {
  auto pins = board_of(2, 2), cells = board_of(2, 2);
  cells.channels = {{"load", "N", true, SSW_U8, 1, 0, 255, 0, 1, 0, 4, 0, {}, 0}};
  cells.mask = {1, 0, 1, 1};
  const TableSpec spec = table_of({at(0, 0), at(0, 2)});
  TableMap map(spec);
  map.mount(0, pins);
  map.mount(1, cells);
  map.freeze();
  ASSERT_EQ(map.channels().size(), 4u);
  std::vector<float> from{1, 2, 3, 4};
  std::vector<float> to(8, 9);
  copy_to_table(map.boards()[1], map.boards()[1].channels[0], 1, from.data(), to.data(), 8);
  EXPECT_EQ(to, (std::vector<float>{9, 9, 1, 9, 9, 9, 3, 4}));
  // After the start, a board that comes back must fit.
  EXPECT_NO_THROW(map.mount(1, cells));
  EXPECT_THROW(map.mount(1, board_of(3, 2)), std::invalid_argument);
  cells.channels[0].maximum = 300;
  EXPECT_THROW(map.mount(1, cells), std::invalid_argument);
}

// A board that comes back in a session is the one that came first, or is refused in one line.
TEST(TableMap, ChangedBoardIsRefusedUntilItIsAsItWas) {
  const DeviceDescription first = board_of(2, 3, "b0");
  const TableSpec spec = table_of({at(0, 0), at(0, 3)});
  TableMap map(spec);
  map.mount(0, first);
  map.mount(1, board_of(2, 3, "b1"));
  map.freeze();
  const std::vector<std::uint32_t> covered = map.boards()[0].cells;
  const auto expect = [&](const std::string& message, const std::function<void(DeviceDescription&)>& change) {
    DeviceDescription d = first;
    change(d);
    try {
      map.mount(0, d);
      ADD_FAILURE() << message;
    } catch (const std::invalid_argument& e) {
      EXPECT_EQ(e.what(), "t.toml:10: board 'line0-0': it has changed since it first came: " + message);
    }
    EXPECT_EQ(map.boards()[0].cells, covered);
    EXPECT_NO_THROW(map.mount(0, first));
  };
  expect("columns from 3 to 2", [](auto& d) { d = board_of(2, 2, "b0"); });
  expect("rows from 2 to 1", [](auto& d) { d = board_of(1, 3, "b0"); });
  expect("rows from 2 to 3", [](auto& d) { d = board_of(3, 2, "b0"); });
  expect("id from 'b0' to 'b1'", [](auto& d) { d.id = "b1"; });
  expect("id from 'b0' to ''", [](auto& d) { d.id.clear(), d.version = 1; });
  expect("sensor 'tilt' from present to absent", [](auto& d) { d.channels.erase(d.channels.begin() + 1); });
  expect("sensor 'load' from absent to present", [](auto& d) {
    d.channels.push_back(d.channels[0]);
    d.channels.back().name = "load";
  });
  expect("maximum of sensor 'slip' from 9 to 8.5", [](auto& d) { d.channels[0].maximum = 8.5F; });
  expect("type of sensor 'slip' from f32 to u16", [](auto& d) { d.channels[0].dtype = SSW_U16; });
  expect("unit of actuator 'force' from '' to 'N'", [](auto& d) { d.channels[2].unit = "N"; });
  expect("mask of cell 4 from 1 to 0", [](auto& d) { d.mask = {1, 1, 1, 1, 0, 1}; });
  expect("layout from a grid to own positions", [](auto& d) { d.positions.resize(6); });
  DeviceDescription restarted = first;
  restarted.boot = 7;
  restarted.program_hash = 8;
  restarted.channels[2].limits.slew = 3;
  EXPECT_NO_THROW(map.mount(0, restarted));
  EXPECT_EQ(map.boards()[0].device->channels[2].limits.slew, 3);
}

}  // namespace
}  // namespace hardware
