// Compiled once per instruction set: foreach_target.h re-includes this file for each.
#include "apron/vm/kernels/Kernels.h"

#include <algorithm>
#include <cstring>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "apron/vm/kernels/Kernels.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include "apron/program/ScalarArithmetic.h"
#include "apron/vm/kernels/CellVectors-inl.h"

HWY_BEFORE_NAMESPACE();
namespace apron::vm {
namespace HWY_NAMESPACE {

// Each is defined in the file of its name.
void add_integer_kernels(KernelTable& table);
void add_mathematics_kernels(KernelTable& table);
void add_random_kernels(KernelTable& table);
void add_filter_kernels(KernelTable& table);

namespace {

// ---- reductions: 16 partial results on every target, so that the order of operations is the same ----

struct SumOp {
  static constexpr float kStart = 0.0F;
  static HWY_INLINE V step(V partial, V cell) { return hn::Add(partial, cell); }
  static float step(float partial, float cell) { return partial + cell; }
  static float join(float a, float b) { return a + b; }
};
struct MinOp {
  static constexpr float kStart = std::numeric_limits<float>::infinity();
  static HWY_INLINE V step(V partial, V cell) { return smaller(cell, partial); }
  static float step(float partial, float cell) { return cell < partial ? cell : partial; }
  static float join(float a, float b) { return step(a, b); }
};
struct MaxOp {
  static constexpr float kStart = -std::numeric_limits<float>::infinity();
  static HWY_INLINE V step(V partial, V cell) { return larger(cell, partial); }
  static float step(float partial, float cell) { return cell > partial ? cell : partial; }
  static float join(float a, float b) { return step(a, b); }
};
struct CountOp : SumOp {
  static HWY_INLINE V step(V partial, V cell) { return hn::Add(partial, as_number(is_true(cell))); }
  static float step(float partial, float cell) { return partial + (cell != 0.0F ? 1.0F : 0.0F); }
};

template <class Op>
float reduce_row(const float* a, std::uint32_t columns) {
  const D d;
  HWY_ALIGN float partial[kLanes];
  for (float& p : partial) p = Op::kStart;
  const std::uint32_t whole = columns / kLanes * kLanes;
  for (std::size_t lane = 0; lane < kLanes; lane += hn::Lanes(d)) {
    V sum = hn::Load(d, partial + lane);
    for (std::size_t x = lane; x < whole; x += kLanes) sum = Op::step(sum, hn::LoadU(d, a + x));
    hn::Store(sum, d, partial + lane);
  }
  for (std::uint32_t x = whole; x < columns; ++x) partial[x - whole] = Op::step(partial[x - whole], a[x]);
  for (std::size_t apart = kLanes / 2; apart > 0; apart /= 2)
    for (std::size_t i = 0; i < apart; ++i) partial[i] = Op::join(partial[i], partial[i + apart]);
  return partial[0];
}

template <class Op>
void reduce(const float* a, std::ptrdiff_t pitch, std::uint32_t rows, std::uint32_t columns,
            float* to) noexcept {
  for (std::uint32_t r = 0; r < rows; ++r, a += pitch) to[r] = reduce_row<Op>(a, columns);
}

template <class T>
void find_true_cells(const std::byte* row, std::uint32_t columns, std::uint64_t* to) noexcept {
  const hn::CappedTag<T, kLanes * sizeof(float) / sizeof(T)> d;
  const T* const cells = reinterpret_cast<const T*>(row);
  for (std::size_t start = 0; start < columns; start += 64) {
    const std::size_t count = std::min<std::size_t>(columns - start, 64);
    std::uint64_t word = 0;
    for (std::size_t x = 0; x < count; x += hn::Lanes(d)) {
      const auto is_false = hn::Eq(hn::LoadU(d, cells + start + x), hn::Zero(d));
      std::uint8_t bytes[8] = {};
      hn::StoreMaskBits(d, hn::Not(is_false), bytes);
      std::uint64_t bits = 0;
      std::memcpy(&bits, bytes, sizeof bits);
      word |= bits << x;
    }
    to[start / 64] = word & (~std::uint64_t{0} >> (64 - count));
  }
}

KernelTable make_table() {
  KernelTable table;
#define APRON_ELEMENTWISE(name, arity, value) fill<name>(table);
#include "apron/program/elementwise.def"
  table.reductions = {reduce<SumOp>, reduce<MinOp>, reduce<MaxOp>, reduce<CountOp>};
  for (std::size_t type = 0; type < table.truths.size(); ++type)
    with_cell_type(static_cast<CellType>(type),
                   [&](auto cell) { table.truths[type] = find_true_cells<decltype(cell)>; });
  add_integer_kernels(table);
  add_mathematics_kernels(table);
  add_random_kernels(table);
  add_filter_kernels(table);
  return table;
}

const KernelTable* table() {
  static const KernelTable kTable = make_table();
  return &kTable;
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace apron::vm
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace apron::vm {

HWY_EXPORT(table);

namespace {

std::vector<NamedKernelTable> find_kernel_tables() {
  std::vector<NamedKernelTable> all;
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    all.push_back({hwy::TargetName(target), HWY_DYNAMIC_DISPATCH(table)()});
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  return all;
}

InstructionSet instruction_set_of(std::string_view target) {
  if (target.starts_with("AVX3")) return InstructionSet::kAvx512;  // AVX3, AVX3_DL, AVX3_ZEN4
  return target == "AVX2" ? InstructionSet::kAvx2 : InstructionSet::kPortable;
}

}  // namespace

const std::vector<NamedKernelTable>& kernel_tables() {
  static const std::vector<NamedKernelTable> kTables = find_kernel_tables();
  return kTables;
}

const KernelTable* kernel_table(InstructionSet isa) {
  const auto find = [](InstructionSet wanted) -> const KernelTable* {
    for (const NamedKernelTable& named : kernel_tables())
      if (instruction_set_of(named.name) == wanted) return named.table;
    return nullptr;
  };
  if (isa != InstructionSet::kAvx512 || find(isa) == nullptr) return find(isa);
  // A single element-wise operation waits for memory, unless it is a mathematical function: see
  // is_bandwidth_bound() in fusion/FusedTrace.cpp.
  static const KernelTable kTable = [&] {
    KernelTable table = *find(InstructionSet::kAvx512);
    if (const KernelTable* narrow = find(InstructionSet::kAvx2))
      for (std::size_t op = 0; op < table.elementwise.size(); ++op)
        if (!program::is_mathematics(static_cast<program::Opcode>(op)))
          table.elementwise[op] = narrow->elementwise[op];
    return table;
  }();
  return &kTable;
}

bool is_supported(InstructionSet isa) { return kernel_table(isa) != nullptr; }

InstructionSet best_instruction_set() {
  for (const InstructionSet isa : {InstructionSet::kAvx512, InstructionSet::kAvx2})
    if (is_supported(isa)) return isa;
  return InstructionSet::kPortable;
}

}  // namespace apron::vm
#endif
