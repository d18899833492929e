// Instructions on neighbourhoods, filters, random numbers, the register stack and group members.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <new>
#include <type_traits>

#include "apron/program/ScalarArithmetic.h"
#include "apron/vm/NumberFormat.h"
#include "apron/vm/Vm.h"
#include "apron/vm/kernels/FloodFill.h"
#include "apron/vm/kernels/Stencil.h"

namespace apron::vm {

using program::Opcode;

namespace {

// Integer sums wrap modulo 2^32.
template <class T>
using SumOf = std::conditional_t<std::is_integral_v<T>, std::uint32_t, double>;

// Calls work(k, row, column) for each cell whose value, rounded down, is a k from 0 to count - 1.
template <class Work>
void for_each_index(ConstPlane at, std::size_t count, const Work& work) {
  with_cell_type(at.type, [&](auto cell) {
    using Index = decltype(cell);
    for (std::uint32_t row = 0; row < at.height; ++row) {
      const Index* index = at.cells<Index>(row);
      for (std::uint32_t x = 0; x < at.width; ++x) {
        if constexpr (std::is_floating_point_v<Index>)
          if (!(index[x] >= 0 && static_cast<double>(index[x]) < static_cast<double>(count))) continue;
        const auto k = static_cast<std::size_t>(index[x]);
        if (k < count) work(k, row, x);  // negative numbers are large
      }
    }
  });
}

// Adds to counts[k] the number of cells of uint8 that are k. In turns four tables count, so that equal cells
// do not wait for each other.
void count_bytes(ConstPlane at, std::uint32_t* counts, std::size_t count) {
  std::array<std::array<std::uint32_t, 256>, 4> tables{};
  for (std::uint32_t row = 0; row < at.height; ++row) {
    const std::uint8_t* const cells = at.cells<std::uint8_t>(row);
    std::uint32_t x = 0;
    for (; x + 4 <= at.width; x += 4) {
      ++tables[0][cells[x]];
      ++tables[1][cells[x + 1]];
      ++tables[2][cells[x + 2]];
      ++tables[3][cells[x + 3]];
    }
    for (; x < at.width; ++x) ++tables[0][cells[x]];
  }
  for (std::size_t k = 0; k < std::min<std::size_t>(count, 256); ++k)
    counts[k] += tables[0][k] + tables[1][k] + tables[2][k] + tables[3][k];
}

// value(k) to cell k, row by row, where the mask allows.
template <class T, class Value>
void write_cells(Plane to, const float* mask, const Value& value) {
  const T* mask_cells = reinterpret_cast<const T*>(mask);
  for (std::uint32_t row = 0; row < to.height; ++row) {
    T* cells = to.cells<T>(row);
    for (std::uint32_t x = 0; x < to.width; ++x)
      if (mask == nullptr || mask_cells[cells - to.cells<T>(0) + x] != T{0})
        cells[x] = static_cast<T>(value(std::size_t{row} * to.width + x));
  }
}

}  // namespace

Status Vm::execute_array_op(const DecodedInstruction& decoded) {
  switch (decoded.op) {
    case Opcode::kFilterSet:
      return set_filter_coefficient(decoded);
    case Opcode::kRandomFloat:
    case Opcode::kRandomGauss:
    case Opcode::kRandomInt:
      return draw_random(decoded);
    case Opcode::kRandomSeed:
      random_stream_ = {std::bit_cast<std::uint32_t>(static_cast<float>(*decoded.scalars[0])), 0};
      return Status::kRunning;
    case Opcode::kStackPush:
      return push_register(decoded);
    case Opcode::kStackPop:
      return pop_register(decoded);
    case Opcode::kStackClear:
      free_stack_planes_.insert(free_stack_planes_.end(), stack_.begin(), stack_.end());
      stack_.clear();
      return Status::kRunning;
    case Opcode::kResGetVar:
    case Opcode::kResSetVar:
    case Opcode::kResGetReg:
    case Opcode::kResSetReg:
      return access_group_member(decoded);
    case Opcode::kScatter:
      return write_masked<&Vm::scatter>(decoded);
    case Opcode::kMatrixProduct: {
      const Plane& first = register_file_.registers[program_.groups[decoded.groups[0]].members.front()];
      return write_masked(decoded, first, [&](const float* mask) { return multiply_matrix(decoded, mask); });
    }
    default:
      return write_masked<&Vm::execute_neighbourhood>(decoded);
  }
}

// The destination has a shape of its own, and may be a source.
Status Vm::scatter(const DecodedInstruction& decoded, const float* mask) {
  if (decoded.planes[1] == nullptr) return scatter_number(decoded, mask);
  with_cell_type(decoded.type, [&](auto cell) {
    using T = decltype(cell);
    auto& sums = std::get<std::vector<SumOf<T>>>(scatter_sums_);
    const std::size_t count = decoded.destination->cell_count();
    std::fill_n(sums.begin(), count, SumOf<T>{0});
    const ConstPlane added = *decoded.planes[1];
    for_each_index(*decoded.planes[0], count, [&](std::size_t k, std::uint32_t row, std::uint32_t x) {
      sums[k] += static_cast<SumOf<T>>(added.cells<T>(row)[x]);
    });
    write_cells<T>(*decoded.destination, mask, [&](std::size_t k) { return sums[k]; });
  });
  return Status::kRunning;
}

// The same number is added n times: a float's sums are exact for as many as a register has cells.
Status Vm::scatter_number(const DecodedInstruction& decoded, const float* mask) {
  const double number = *decoded.scalars[1];
  if (!program::is_cell_value(decoded.type, number)) return fail_cell_value(number, decoded.type);
  auto& counts = std::get<std::vector<std::uint32_t>>(scatter_sums_);
  const std::size_t count = decoded.destination->cell_count();
  std::fill_n(counts.begin(), count, 0U);
  if (decoded.planes[0]->type == CellType::kUint8)
    count_bytes(*decoded.planes[0], counts.data(), count);
  else
    for_each_index(*decoded.planes[0], count,
                   [&](std::size_t k, std::uint32_t, std::uint32_t) { ++counts[k]; });
  with_cell_type(decoded.type, [&](auto cell) {
    using T = decltype(cell);
    const auto added = static_cast<SumOf<T>>(static_cast<T>(number));
    write_cells<T>(*decoded.destination, mask, [&](std::size_t k) {
      return counts[k] == 0 ? SumOf<T>{0} : SumOf<T>{0} + counts[k] * added;  // 0 of -0
    });
  });
  return Status::kRunning;
}

Status Vm::multiply_matrix(const DecodedInstruction& decoded, const float* mask) {
  const auto members = [&](std::size_t k) -> const std::vector<std::uint32_t>& {
    return program_.groups[decoded.groups[k]].members;
  };
  const auto &y = members(0), &x = members(1), &weights = members(2);
  const Plane first = register_file_.registers[y.front()];
  MatrixProduct product;
  product.mask = mask;
  matrix_planes_.clear();
  for (const auto* group : {&x, &y})
    for (const std::uint32_t member : *group) matrix_planes_.push_back(register_file_.registers[member].data);
  matrix_weights_.clear();
  for (std::size_t k = 0; k < y.size(); k += kMatrixRows)
    for (std::size_t j = 0; j < x.size(); ++j)
      for (std::size_t o = k; o < k + kMatrixRows; ++o)
        matrix_weights_.push_back(
            o < y.size() ? static_cast<float>(register_file_.scalars[weights[o * x.size() + j]]) : 0.0F);
  product.x = matrix_planes_.data();
  product.y = matrix_planes_.data() + x.size();
  product.inputs = static_cast<std::uint32_t>(x.size());
  product.outputs = static_cast<std::uint32_t>(y.size());
  product.weights = matrix_weights_.data();
  product.pitch = first.pitch;
  product.columns = first.width;
  const MatrixProductKernel kernel = executor_.kernels().matrix_product;
  executor_.parallel_for_rows(first.height, first.width,
                              [&](std::uint32_t begin, std::uint32_t end) { kernel(product, begin, end); });
  return Status::kRunning;
}

Status Vm::execute_neighbourhood(const DecodedInstruction& decoded, const float* mask) {
  if (program::is_integer(decoded.type) && decoded.op == Opcode::kFilterDo)
    return filter_integers(decoded, mask);
  if (program::is_integer(decoded.type) && decoded.op <= Opcode::kNearAll)
    return reduce_integer_neighbours(decoded, mask);
  const ConstPlane a = *decoded.planes[0];
  const Plane to = mask == nullptr ? *decoded.destination : decoded.scratch;
  switch (decoded.op) {
    case Opcode::kFilterDo: {
      const program::Filter& with = program_.filters[decoded.table_index];
      apply_filter(executor_, {with.width, with.height, with.coefficients.data()}, *decoded.destination, a,
                   boundary_, mask);
      return executor_.is_stopped() ? Status::kInterrupted : Status::kRunning;
    }
    case Opcode::kFlood:
      components_.flood(to, a, *decoded.planes[1], executor_.kernels());
      break;
    case Opcode::kDistance:
      distance_transform(to, a);
      break;
    case Opcode::kSpreadMax:
      components_.spread_max(to, a, *decoded.planes[1], executor_.kernels());
      break;
    case Opcode::kSpreadSum:
      components_.spread_sum(to, a, *decoded.planes[1], executor_.kernels());
      break;
    case Opcode::kSpreadNumber:
      components_.spread_number(to, a, executor_.kernels());
      break;
    default:
      reduce_neighbours(executor_, decoded.op, *decoded.scalars[1] == 8.0, *decoded.destination, a, boundary_,
                        mask);
      return Status::kRunning;
  }
  if (mask != nullptr) copy_plane(*decoded.destination, to, mask);
  return Status::kRunning;
}

// near.sum to near.all of integers: one shift for each neighbour. Sums modulo 2^n have no order.
Status Vm::reduce_integer_neighbours(const DecodedInstruction& decoded, const float* mask) {
  if (!has_boundary_value(decoded.type)) return fail_cell_value(boundary_.value, decoded.type);
  static constexpr std::array<Offset, 8> kOffsets{
      {{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, 1}, {1, -1}, {-1, -1}}};
  static constexpr std::array<Opcode, 5> kCombine{Opcode::kAdd, Opcode::kMin, Opcode::kMax, Opcode::kOr,
                                                  Opcode::kAnd};
  const Opcode combine = kCombine[index_of(decoded.op) - index_of(Opcode::kNearSum)];
  const Plane sum = decoded.scratch, neighbour = decoded.second_scratch;
  const std::size_t count = *decoded.scalars[1] == 8.0 ? 8 : 4;
  for (std::size_t i = 0; i < count; ++i) {
    shift(executor_, i == 0 ? sum : neighbour, *decoded.planes[0], kOffsets[i], boundary_, nullptr);
    if (i == 0) continue;
    Block block(sum);
    block.source = {sum.data, neighbour.data, nullptr};
    executor_.run_kernel(executor_.kernels().kernel(combine, 0, false, decoded.type), block);
  }
  copy_plane(*decoded.destination, sum, mask);
  return Status::kRunning;
}

// A product and a sum modulo 2^n for each element that is not 0.
Status Vm::filter_integers(const DecodedInstruction& decoded, const float* mask) {
  if (!has_boundary_value(decoded.type)) return fail_cell_value(boundary_.value, decoded.type);
  const program::Filter& filter = program_.filters[decoded.table_index];
  const Plane sum = decoded.scratch, neighbour = decoded.second_scratch;
  Block zeros(sum);
  zeros.integer[0] = 0;
  executor_.run_kernel(executor_.kernels().kernel(Opcode::kCopy, 1, false, decoded.type), zeros);
  const std::vector<double>& elements = filter_elements_[decoded.table_index];
  for (std::uint32_t i = 0; i < elements.size(); ++i) {
    if (executor_.is_stopped()) return Status::kInterrupted;
    const double element = elements[i];
    if (element == 0.0) continue;
    if (!program::is_cell_value(program::CellType::kInt32, element))
      return fail(Status::kFailed, format_number(element) + ", an element of the filter '" + filter.name +
                                       "', is no " +
                                       std::string(program::cell_type_name(program::CellType::kInt32)) +
                                       ": filters of integers have whole elements");
    const Offset by{(static_cast<std::int64_t>(filter.width) - 1) / 2 - i % filter.width,
                    (static_cast<std::int64_t>(filter.height) - 1) / 2 - i / filter.width};
    shift(executor_, neighbour, *decoded.planes[0], by, boundary_, nullptr);
    Block block(sum);
    block.source = {neighbour.data, nullptr, sum.data};
    block.integer[1] = static_cast<std::int32_t>(element);
    executor_.run_kernel(executor_.kernels().kernel(Opcode::kMac, 2, false, decoded.type), block);
  }
  copy_plane(*decoded.destination, sum, mask);
  return Status::kRunning;
}

// Copies all cells, or those where the mask is non-zero. All planes have the same shape, pitch and type.
void Vm::copy_plane(Plane y, ConstPlane a, const float* mask) noexcept {
  Block block(y, mask);
  block.source[0] = a.data;
  executor_.run_kernel(executor_.kernels().kernel(Opcode::kCopy, 0, mask != nullptr, y.type), block);
}

Status Vm::set_filter_coefficient(const DecodedInstruction& decoded) {
  program::Filter& filter = program_.filters[decoded.table_index];
  const double index = *decoded.scalars[1];
  if (!(index >= 0.0 && index < static_cast<double>(filter.coefficients.size())))
    return fail(Status::kFailed, "the filter '" + filter.name + "' of " + std::to_string(filter.width) + "x" +
                                     std::to_string(filter.height) + " has no element number " +
                                     format_number(index));
  const double element = *decoded.scalars[2];
  filter.coefficients[static_cast<std::size_t>(index)] = static_cast<float>(element);
  filter_elements_[decoded.table_index][static_cast<std::size_t>(index)] = element;
  return Status::kRunning;
}

Status Vm::draw_random(const DecodedInstruction& decoded) {
  const RandomStream draw = random_stream_;
  ++random_stream_.draw_index;  // independent of the mask
  const double a = *decoded.scalars[0], b = *decoded.scalars[1];
  if (decoded.destination_variable != nullptr) {
    *decoded.destination_variable =
        program::to_scalar(draw.draw_one(executor_.kernels(), decoded.op, 0, 0, a, b));
    return Status::kRunning;
  }
  return write_masked(decoded, *decoded.destination,
                      [&](const float* mask) { return fill_random(decoded, draw, mask); });
}

Status Vm::fill_random(const DecodedInstruction& decoded, const RandomStream& draw, const float* mask) {
  const double a = *decoded.scalars[0], b = *decoded.scalars[1];
  const Plane y = *decoded.destination;
  with_cell_type(y.type, [&](auto cell) {
    using T = decltype(cell);
    executor_.parallel_for_rows(y.height, y.width, [&](std::uint32_t first, std::uint32_t last) {
      for (std::uint32_t row = first; row < last; ++row) {
        T* to = y.cells<T>(row);
        const T* on = mask != nullptr ? reinterpret_cast<const T*>(mask) + (to - y.cells<T>(0)) : nullptr;
        draw.fill_row(executor_.kernels(), decoded.op, row, a, b, to, on, y.width);
      }
    });
  });
  return Status::kRunning;
}

Status Vm::push_register(const DecodedInstruction& decoded) {
  const ConstPlane a = *decoded.planes[0];
  if (stack_.size() == program::kMaxStackDepth)
    return fail(Status::kFailed,
                "more than " + std::to_string(program::kMaxStackDepth) + " registers are on the stack");
  auto slot = free_stack_planes_.begin();
  while (slot != free_stack_planes_.end() && !same_shape_and_type(*slot, a)) ++slot;
  if (slot == free_stack_planes_.end()) {
    stack_bytes_ += a.cell_count() * a.cell_bytes();
    if (stack_bytes_ > program::kMaxStackBytes)
      return fail(Status::kFailed,
                  "the stack takes more than " + std::to_string(program::kMaxStackBytes) + " bytes");
    try {
      slot = free_stack_planes_.insert(free_stack_planes_.end(),
                                       plane_store_.allocate(a.width, a.height, a.type));
    } catch (const std::bad_alloc&) {
      return fail(Status::kFailed, "there is not enough memory for the stack");
    }
  }
  copy_plane(*slot, a, nullptr);
  stack_.push_back(*slot);
  free_stack_planes_.erase(slot);
  return Status::kRunning;
}

Status Vm::pop_register(const DecodedInstruction& decoded) {
  if (stack_.empty()) return fail(Status::kFailed, "stack.pop_reg finds the stack empty");
  const Plane top = stack_.back();
  if (!same_shape(top, *decoded.destination))
    return fail(Status::kFailed, "stack.pop_reg finds a register of " + format_shape(top) +
                                     ", and the destination is " + format_shape(*decoded.destination));
  if (top.type != decoded.type)
    return fail(Status::kFailed,
                "stack.pop_reg finds a register of " + std::string(program::cell_type_name(top.type)) +
                    ", and the destination is " + std::string(program::cell_type_name(decoded.type)));
  const float* mask = nullptr;
  const WriteAccess access = check_write_access(decoded, *decoded.destination, mask);
  if (access == WriteAccess::kShapeMismatch) return report_mask_mismatch(*decoded.destination);
  if (access == WriteAccess::kAllowed) copy_plane(*decoded.destination, top, mask);
  stack_.pop_back();
  free_stack_planes_.push_back(top);
  return Status::kRunning;
}

Status Vm::access_group_member(const DecodedInstruction& decoded) {
  const program::OperandGroup& group = program_.groups[decoded.groups[0]];
  const double number = *decoded.scalars[1];
  if (!(number >= 0.0 && number < static_cast<double>(group.members.size()) && number == std::floor(number)))
    return fail(Status::kFailed, "'" + group.name + "' has " + std::to_string(group.members.size()) +
                                     (group.members.size() == 1 ? " element" : " elements") +
                                     ", numbered from 0; there is no number " + format_number(number));
  const std::uint32_t index = group.members[static_cast<std::size_t>(number)];
  if (decoded.op == Opcode::kResGetVar) {
    *decoded.destination_variable = register_file_.scalars[index];
    return Status::kRunning;
  }
  if (decoded.op == Opcode::kResSetVar) {
    register_file_.scalars[index] = *decoded.scalars[2];
    return Status::kRunning;
  }
  return access_group_register(decoded, register_file_.registers[index]);
}

Status Vm::access_group_register(const DecodedInstruction& decoded, Plane reg) {
  const bool get = decoded.op == Opcode::kResGetReg;
  const Plane y = get ? *decoded.destination : reg;
  const ConstPlane a = get                            ? ConstPlane(reg)
                       : decoded.planes[2] != nullptr ? ConstPlane(*decoded.planes[2])
                                                      : ConstPlane();
  if (a.data != nullptr && !same_shape(y, a))
    return fail(Status::kFailed,
                "a register of " + format_shape(a) + " does not go into one of " + format_shape(y));
  if (a.data != nullptr && a.type != y.type)
    return fail(Status::kFailed, "a register of " + std::string(program::cell_type_name(a.type)) +
                                     " does not go into one of " +
                                     std::string(program::cell_type_name(y.type)));
  if (a.data == nullptr && !program::is_cell_value(y.type, *decoded.scalars[2]))
    return fail_cell_value(*decoded.scalars[2], y.type);
  return write_masked(decoded, y, [&](const float* mask) {
    if (a.data != nullptr) {
      if (a.data != y.data) copy_plane(y, a, mask);
      return Status::kRunning;
    }
    Block block(y, mask);
    if (program::is_integer(y.type))
      block.integer[0] = static_cast<std::int32_t>(*decoded.scalars[2]);
    else
      block.scalar[0] = static_cast<float>(*decoded.scalars[2]);
    executor_.run_kernel(executor_.kernels().kernel(Opcode::kCopy, 1, mask != nullptr, y.type), block);
    return Status::kRunning;
  });
}

}  // namespace apron::vm
