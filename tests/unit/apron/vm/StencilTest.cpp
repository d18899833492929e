// Filters and neighbourhoods equal cell-by-cell sums in the order that opcodes.def declares, with every
// kernel table, boundary rule, mask and shape.
#include "apron/vm/kernels/Stencil.h"

#include <gtest/gtest.h>

#include "apron/vm/PlaneStore.h"
#include "tests/unit/apron/vm/TestProgram.h"

namespace apron::vm::test {
namespace {

using program::BoundaryRule;

struct Extended {
  ConstPlane plane;
  BoundaryCondition boundary;

  float operator()(std::int64_t x, std::int64_t y) const {
    const std::int64_t column = resolve_boundary_index(x, plane.width, boundary.rule);
    const std::int64_t row = resolve_boundary_index(y, plane.height, boundary.rule);
    if (column < 0 || row < 0) return boundary.rule == BoundaryRule::kValue ? boundary.value : 0.0F;
    return plane.row(static_cast<std::uint32_t>(row))[column];
  }
};

float correlated(const Extended& a, const FilterView& filter, std::int64_t x, std::int64_t y) {
  float sum = 0.0F;
  for (std::int64_t j = 0; j < filter.height; ++j)
    for (std::int64_t i = 0; i < filter.width; ++i) {
      const float element = filter.coefficients[j * filter.width + i];
      const float product = element * a(x + i - (filter.width - 1) / 2, y + j - (filter.height - 1) / 2);
      if (element != 0.0F) sum = sum + product;
    }
  return sum;
}

float join(Opcode op, float a, float b) {
  if (op == Opcode::kNearSum) return a + b;
  if (op == Opcode::kNearMin) return a < b ? a : b;
  if (op == Opcode::kNearMax) return a > b ? a : b;
  const bool truth = op == Opcode::kNearAny ? a != 0.0F || b != 0.0F : a != 0.0F && b != 0.0F;
  return truth ? 1.0F : 0.0F;
}

float reduced(const Extended& a, Opcode op, bool eight, std::int64_t x, std::int64_t y) {
  const auto sides = [&](std::int64_t row) { return join(op, a(x - 1, row), a(x + 1, row)); };
  const auto whole = [&](std::int64_t row) { return join(op, sides(row), a(x, row)); };
  return eight ? join(op, sides(y), join(op, whole(y - 1), whole(y + 1)))
               : join(op, sides(y), join(op, a(x, y - 1), a(x, y + 1)));
}

class Stencil : public testing::TestWithParam<BoundaryRule> {
 protected:
  struct Case {
    PlaneStore store;
    Plane a, y, mask;
    Cells before;
  };

  Case make_case(Size size, bool masked, std::mt19937& rng) {
    Case c;
    for (Plane* plane : {&c.a, &c.y, &c.mask}) *plane = c.store.allocate(size.width, size.height);
    const std::size_t n = c.a.cell_count();
    write_cells(c.a, random_cells(n, rng));
    write_cells(c.y, c.before = random_cells(n, rng));
    write_cells(c.mask, masked ? random_mask(n, rng) : Cells(n, 1.0F));
    return c;
  }

  // Fails unless y is want(x, y) where the mask is non-zero and unchanged elsewhere.
  template <class Want>
  void expect(const Case& c, bool masked, const std::string& what, const Want& want) {
    for (std::uint32_t y = 0; y < c.y.height; ++y)
      for (std::uint32_t x = 0; x < c.y.width; ++x) {
        const bool on = !masked || c.mask.row(y)[x] != 0.0F;
        const float wanted = on ? want(x, y) : c.before[std::size_t{y} * c.y.width + x];
        ASSERT_TRUE(bits_equal(c.y.row(y)[x], wanted))
            << what << " column " << x << " row " << y << ": " << c.y.row(y)[x] << ", not " << wanted;
      }
  }
};

INSTANTIATE_TEST_SUITE_P(Rules, Stencil,
                         testing::Values(BoundaryRule::kZero, BoundaryRule::kReplicate, BoundaryRule::kWrap,
                                         BoundaryRule::kReflect, BoundaryRule::kValue));

TEST_P(Stencil, FiltersMatchTheirDefinition) {
  const BoundaryCondition boundary{GetParam(), 1.25F};
  std::mt19937 rng(3 + first_program_seed());
  std::size_t checked = 0;
  // Without zeros, several rows are computed at once.
  for (const float offset : {0.6F, 0.7F})
    for (const Size filter_size :
         {Size{3, 3}, Size{4, 2}, Size{7, 5}, Size{1, 9}, Size{19, 1}, Size{11, 11}, Size{255, 2}}) {
      Cells coefficients;
      for (std::uint32_t i = 0; i < filter_size.width * filter_size.height; ++i)
        coefficients.push_back(static_cast<float>(static_cast<int>(rng() % 7)) * 0.3F - offset);
      const FilterView filter{filter_size.width, filter_size.height, coefficients.data()};
      for (const Size size : {Size{1, 1}, Size{3, 5}, Size{17, 6}, Size{37, 150}, Size{300, 4}})
        for (const NamedKernelTable& target : kernel_tables()) {
          const bool masked = rng() % 2 == 0;
          Case c = make_case(size, masked, rng);
          Executor executor(*target.table, 2, 64);
          apply_filter(executor, filter, c.y, c.a, boundary, masked ? c.mask.data : nullptr);
          expect(c, masked, std::string(target.name) + " " + std::to_string(filter.width),
                 [&](std::int64_t x, std::int64_t y) {
                   return correlated({c.a, boundary}, filter, x, y);
                 });
          if (HasFatalFailure()) return;
          ++checked;
        }
    }
  count_cases(checked);
}

TEST_P(Stencil, NeighboursMatchTheirDefinition) {
  const BoundaryCondition boundary{GetParam(), 1.25F};
  std::mt19937 rng(4 + first_program_seed());
  std::size_t checked = 0;
  for (const Opcode op :
       {Opcode::kNearSum, Opcode::kNearMin, Opcode::kNearMax, Opcode::kNearAny, Opcode::kNearAll})
    for (const bool eight : {false, true})
      for (const Size size : {Size{1, 1}, Size{2, 2}, Size{3, 5}, Size{17, 6}, Size{100, 7}})
        for (const NamedKernelTable& target : kernel_tables()) {
          const bool masked = rng() % 2 == 0;
          Case c = make_case(size, masked, rng);
          Executor executor(*target.table, 2, 64);
          reduce_neighbours(executor, op, eight, c.y, c.a, boundary, masked ? c.mask.data : nullptr);
          expect(c, masked, std::string(target.name), [&](std::int64_t x, std::int64_t y) {
            return reduced({c.a, boundary}, op, eight, x, y);
          });
          if (HasFatalFailure()) return;
          ++checked;
        }
  count_cases(checked);
}

}  // namespace
}  // namespace apron::vm::test
