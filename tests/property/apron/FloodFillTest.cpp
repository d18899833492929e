// flood, distance and what spreads, compared with their one-step rules iterated to the fixed point.
#include <gtest/gtest.h>

#include "tests/unit/apron/vm/TestProgram.h"

namespace apron::vm::test {
namespace {

struct Image {
  int width, height;
  Cells cells;
  float at(int x, int y) const {
    return x < 0 || y < 0 || x >= width || y >= height ? 0.0F : cells[index(x, y)];
  }
  std::size_t index(int x, int y) const { return static_cast<std::size_t>(y * width + x); }
};

// rule(x, y, now) returns the cell's next value.
template <class Rule>
Image iterate_to_fixed_point(Image now, const Rule& rule) {
  for (;;) {
    Image next = now;
    for (int y = 0; y < now.height; ++y)
      for (int x = 0; x < now.width; ++x) next.cells[now.index(x, y)] = rule(x, y, now);
    if (next.cells == now.cells) return now;
    now = next;
  }
}

bool has_neighbour(const Image& i, int x, int y) {
  return i.at(x - 1, y) != 0 || i.at(x + 1, y) != 0 || i.at(x, y - 1) != 0 || i.at(x, y + 1) != 0;
}

Image reference_flood(const Image& seed, const Image& mask) {
  Image zero{seed.width, seed.height, Cells(seed.cells.size(), 0.0F)};
  return iterate_to_fixed_point(zero, [&](int x, int y, const Image& now) {
    return mask.at(x, y) != 0 && (seed.at(x, y) != 0 || has_neighbour(now, x, y)) ? 1.0F : 0.0F;
  });
}

Image reference_distance(const Image& a) {
  Image zero{a.width, a.height, Cells(a.cells.size(), 0.0F)};
  return iterate_to_fixed_point(zero, [&](int x, int y, const Image& now) {
    if (!(a.at(x, y) != 0)) return 0.0F;
    return 1.0F + std::min(std::min(now.at(x - 1, y), now.at(x + 1, y)),
                           std::min(now.at(x, y - 1), now.at(x, y + 1)));
  });
}

Image reference_spread_max(const Image& a, const Image& mask) {
  const auto value = [&](int x, int y) { return std::isnan(a.at(x, y)) ? -INFINITY : a.at(x, y) + 0.0F; };
  Image start = a;
  for (int y = 0; y < a.height; ++y)
    for (int x = 0; x < a.width; ++x) start.cells[a.index(x, y)] = mask.at(x, y) != 0 ? value(x, y) : 0.0F;
  return iterate_to_fixed_point(start, [&](int x, int y, const Image& now) {
    float largest = now.at(x, y);
    if (!(mask.at(x, y) != 0)) return 0.0F;
    for (const auto& [dx, dy] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}})
      if (mask.at(x + dx, y + dy) != 0) largest = std::max(largest, now.at(x + dx, y + dy));
    return largest;
  });
}

// Each component's cells by a flood from its own cell, in row-major order.
Image reference_spread_sum(const Image& a, const Image& mask) {
  Image result{a.width, a.height, Cells(a.cells.size(), 0.0F)};
  std::vector<bool> is_done(a.cells.size());
  for (std::size_t i = 0; i < a.cells.size(); ++i) {
    if (is_done[i] || !(mask.cells[i] != 0)) continue;
    Image seed{a.width, a.height, Cells(a.cells.size(), 0.0F)};
    seed.cells[i] = 1.0F;
    const Image component = reference_flood(seed, mask);
    double sum = 0.0;
    for (std::size_t k = 0; k < a.cells.size(); ++k)
      if (component.cells[k] != 0) sum += static_cast<double>(a.cells[k]);
    for (std::size_t k = 0; k < a.cells.size(); ++k) {
      if (component.cells[k] == 0) continue;
      is_done[k] = true;
      result.cells[k] = static_cast<float>(sum);
    }
  }
  return result;
}

// A spiral corridor one cell wide: the one-step rule needs as many iterations as the corridor has cells.
Image spiral(int n) {
  Image image{n, n, Cells(static_cast<std::size_t>(n * n), 0.0F)};
  int x = 0, y = 0, dx = 1, dy = 0;
  const auto free = [&](int px, int py) {
    return px >= 0 && py >= 0 && px < n && py < n && image.at(px, py) == 0;
  };
  // Turn right at the image edge and one cell before a visited cell. Two turns in a row end the spiral.
  for (int turns = 0; turns < 2;) {
    image.cells[image.index(x, y)] = 1.0F;
    const bool wall = !free(x + dx, y + dy) || (image.at(x + 2 * dx, y + 2 * dy) != 0);
    if (wall) {
      const int old = dx;
      dx = -dy;
      dy = old;
      ++turns;
    } else {
      x += dx;
      y += dy;
      turns = 0;
    }
  }
  return image;
}

// Cells of any type.
void write_any(const Plane& plane, const Cells& from) {
  with_cell_type(plane.type, [&](auto cell) {
    for (std::uint32_t y = 0; y < plane.height; ++y)
      for (std::uint32_t x = 0; x < plane.width; ++x)
        plane.cells<decltype(cell)>(y)[x] =
            static_cast<decltype(cell)>(from[std::size_t{y} * plane.width + x]);
  });
}
Cells read_any(const Plane& plane) {
  Cells cells;
  for (std::uint32_t y = 0; y < plane.height; ++y)
    for (std::uint32_t x = 0; x < plane.width; ++x) cells.push_back(cell_as_float(plane, x, y));
  return cells;
}

Image run(Opcode op, const Image& a, const Image* b, bool in_place, const Cells* mask = nullptr) {
  TestProgram build;
  const auto w = static_cast<std::uint32_t>(a.width), h = static_cast<std::uint32_t>(a.height);
  const Operand y = build.reg(w, h), x = build.reg(w, h), m = build.reg(w, h), on = build.reg(w, h);
  if (mask != nullptr) build.add(Opcode::kMaskOn, {}, on);
  build.add(op, y, x, b != nullptr ? m : Operand{});
  const program::Program program = build.finish();
  EXPECT_EQ(program::verify(program), "");
  FakeHost host;
  Vm vm(program, {}, host);
  write_cells(vm.plane(x.index), a.cells);
  if (b != nullptr) write_cells(vm.plane(m.index), b->cells);
  if (mask != nullptr) write_cells(vm.plane(on.index), *mask);
  if (in_place) write_cells(vm.plane(y.index), a.cells);
  EXPECT_EQ(vm.run(), Status::kEnded) << vm.error();
  return {a.width, a.height, read_cells(vm.plane(y.index))};
}

void expect_same(const Image& want, const Image& got, const char* what, unsigned seed) {
  for (std::size_t i = 0; i < want.cells.size(); ++i)
    ASSERT_TRUE(bits_equal(want.cells[i], got.cells[i]))
        << what << " seed " << seed << " column " << i % static_cast<std::size_t>(want.width) << " row "
        << i / static_cast<std::size_t>(want.width) << ": " << got.cells[i] << ", not " << want.cells[i];
}

void check_all(const Image& a, const Image& mask, unsigned seed) {
  expect_same(reference_flood(a, mask), run(Opcode::kFlood, a, &mask, false), "flood", seed);
  expect_same(reference_distance(mask), run(Opcode::kDistance, mask, nullptr, false), "distance", seed);
  expect_same(reference_spread_max(a, mask), run(Opcode::kSpreadMax, a, &mask, false), "spread.max", seed);
  if (a.cells.size() < 700)
    expect_same(reference_spread_sum(a, mask), run(Opcode::kSpreadSum, a, &mask, false), "spread.sum", seed);
}

TEST(FloodFill, MatchesIteratedReference) {
  const auto seeds = program_seeds(120);
  for (const unsigned seed : seeds) {
    std::mt19937 rng(seed);
    const Size size = kSizes[seed % std::size(kSizes)];
    Image mask{static_cast<int>(size.width), static_cast<int>(size.height), {}}, a = mask;
    const unsigned percent = 35 + seed % 60;
    for (std::size_t i = 0; i < std::size_t{size.width} * size.height; ++i)
      mask.cells.push_back(rng() % 100 < percent ? (rng() % 9 == 0 ? NAN : -2.0F) : 0.0F);
    a.cells = random_cells(mask.cells.size(), rng);
    if (seed % 2 == 0)
      for (float& v : a.cells) v = rng() % 40 == 0 ? v : 0.0F;
    check_all(a, mask, seed);
    if (::testing::Test::HasFatalFailure()) return;
  }
  count_cases(seeds.size());
}

// Seeds and masks of any type: the last cell of each component gives its number, and its flood.
TEST(FloodFill, TakesTruthsOfAnyType) {
  const auto seeds = program_seeds(60);
  for (const unsigned seed : seeds) {
    std::mt19937 rng(seed);
    const Size size = kSizes[seed % std::size(kSizes)];
    const std::size_t cells = std::size_t{size.width} * size.height;
    const Image shape{static_cast<int>(size.width), static_cast<int>(size.height), Cells(cells, 0.0F)};
    Image mask = shape, start = shape, numbers = shape;
    for (std::size_t i = 0; i < cells; ++i) {
      mask.cells[i] = rng() % 100 < 40 + seed % 60 ? 2.0F : 0.0F;
      start.cells[i] = rng() % 20 == 0 ? 1.0F : 0.0F;
      numbers.cells[i] = static_cast<float>(i + 1);
    }
    const auto type = [&](unsigned of) { return static_cast<CellType>(of % program::kCellTypeCount); };
    TestProgram build;
    const auto reg = [&](CellType of) {
      const Operand operand = build.reg(size.width, size.height);
      build.program.registers[operand.index].type = of;
      return operand;
    };
    const Operand m = reg(type(seed)), s = reg(type(seed / 4)), flooded = reg(type(seed / 16)),
                  number = reg(CellType::kInt32), largest = reg(CellType::kInt32), a = reg(CellType::kInt32);
    build.add(Opcode::kFlood, flooded, s, m);
    build.add(Opcode::kSpreadNumber, number, m);
    build.add(Opcode::kSpreadMax, largest, a, m);
    const program::Program program = build.finish();
    ASSERT_EQ(program::verify(program), "");
    FakeHost host;
    Vm vm(program, {}, host);
    write_any(vm.plane(m.index), mask.cells);
    write_any(vm.plane(s.index), start.cells);
    write_any(vm.plane(a.index), numbers.cells);
    ASSERT_EQ(vm.run(), Status::kEnded) << vm.error();
    const Image want = reference_spread_max(numbers, mask);
    expect_same(reference_flood(start, mask), {shape.width, shape.height, read_any(vm.plane(flooded.index))},
                "flood", seed);
    expect_same(want, {shape.width, shape.height, read_any(vm.plane(number.index))}, "spread.number", seed);
    expect_same(want, {shape.width, shape.height, read_any(vm.plane(largest.index))}, "spread.max", seed);
    if (::testing::Test::HasFatalFailure()) return;
  }
  count_cases(seeds.size());
}

TEST(FloodFill, FollowsLongCorridor) {
  for (const int n : {5, 24, 33}) {
    const Image corridor = spiral(n);
    Image seed{n, n, Cells(corridor.cells.size(), 0.0F)};
    seed.cells[0] = 3.0F;
    const Image reached = run(Opcode::kFlood, seed, &corridor, false);
    EXPECT_EQ(reached.cells, corridor.cells) << n;
    check_all(seed, corridor, static_cast<unsigned>(n));
  }
}

TEST(FloodFill, RespectsMask) {
  std::mt19937 rng(7);
  const Image mask{17, 33, random_mask(17 * 33, rng)}, a{17, 33, random_cells(17 * 33, rng)};
  const Cells on = random_mask(17 * 33, rng);
  Image want = reference_spread_max(a, mask);
  for (std::size_t i = 0; i < on.size(); ++i)
    if (on[i] == 0) want.cells[i] = a.cells[i];
  expect_same(want, run(Opcode::kSpreadMax, a, &mask, true, &on), "spread.max under a mask", 7);
}

}  // namespace
}  // namespace apron::vm::test
