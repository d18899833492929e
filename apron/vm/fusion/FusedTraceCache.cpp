#include "apron/vm/fusion/FusedTraceCache.h"

#include <algorithm>

namespace apron::vm {
namespace {

// Compilation limits for the whole program; beyond them the rest runs one instruction at a time.
constexpr std::size_t kMaxGraphNodes = 30'000;
constexpr std::size_t kMaxTracedInstructions = 2'000'000;
constexpr std::size_t kMaxTraceBytes = std::size_t{1} << 28;

}  // namespace

struct FusedTraceCache::Builder {
  FusedTraceCache& cache;
  const program::Program& program;
  const std::vector<DecodedInstruction>& decoded;
  RegisterFile& register_file;
  Executor& executor;
  InstructionSet code_isa;
  const FusionOptions& options;
  unsigned threads;
  std::size_t parallel_cells;
  FlowAnalysis flow{program, options.observed};
  FilterPrediction filters{program, decoded, register_file};
  std::size_t node_count = 0, traced_instructions = 0, memory_bytes = 0;

  void compile_reachable_traces() {
    std::vector<bool> visited(program.code.size(), false);
    std::vector<std::uint32_t> worklist{0};
    const auto enqueue = [&](std::size_t at) {
      if (visited[at]) return;
      visited[at] = true;
      worklist.push_back(static_cast<std::uint32_t>(at));
    };
    visited[0] = true;
    while (!worklist.empty() && node_count < kMaxGraphNodes && traced_instructions < kMaxTracedInstructions &&
           memory_bytes < kMaxTraceBytes) {
      const std::uint32_t at = worklist.back();
      worklist.pop_back();
      bool traced = false;
      for (const bool masked : {false, true}) {
        if (masked && !flow.has_masks()) continue;
        const Trace trace =
            build_trace(program, decoded, flow, filters, at, masked, {options.max_array_instructions});
        traced_instructions += trace.instructions.size() + 1;
        if (trace.instructions.empty()) continue;
        traced = true;
        enqueue(trace.exit);
        if (is_worth_compiling(trace)) compile(trace, masked);
      }
      if (!traced) flow.for_each_successor(at, enqueue);
    }
  }

  // A single instruction on the own cell gains nothing, a stencil does.
  bool is_worth_compiling(const Trace& trace) const {
    return trace.array_instructions >= 2 || std::ranges::any_of(trace.instructions, [&](std::uint32_t at) {
             return decoded[at].dispatch == DispatchKind::kArrayOp;
           });
  }

  void compile(const Trace& trace, bool masked) {
    ValueGraph graph = build_value_graph(program, decoded, flow, filters, trace, masked);
    node_count += graph.nodes.size() + 1;
    FusionPlanOptions plan_options;
    const bool large = std::size_t{trace.width} * trace.height >= parallel_cells;
    plan_options.threads = large ? threads : 1;
    plan_options.slices = options.slices;
    plan_options.strip_columns = options.strip_columns;
    plan_options.block_rows = options.block_rows;
    plan_options.rows_per_iteration = options.rows_per_iteration;
    FusionPlan plan = make_fusion_plan(graph, trace.width, trace.height, plan_options);
    FusedTrace::Environment environment{
        executor, register_file, cache.back_buffers_, code_isa,
        flow.has_only_zero_boundaries() && trace.width % lanes(trace.type) == 0};
    auto fused_trace = std::make_unique<FusedTrace>(trace, std::move(graph), std::move(plan), environment);
    for (const std::uint32_t at : trace.instructions)
      if (decoded[at].op == program::Opcode::kFilterDo) {
        const std::uint32_t index = decoded[at].table_index;
        fused_trace->require_filter(program.filters[index], filters.find(index)->coefficients);
      }
    memory_bytes += fused_trace->memory_bytes();
    for (const std::uint32_t reg : fused_trace->double_buffered_registers()) {
      Plane& back_buffer = cache.back_buffers_[reg];
      if (back_buffer.data == nullptr)
        back_buffer = cache.plane_store_.allocate(trace.width, trace.height, trace.type);
    }
    Entry& entry = cache.entries_[trace.entry];
    (masked ? entry.masked : entry.unmasked) = fused_trace.get();
    cache.traces_.push_back(std::move(fused_trace));
  }
};

FusedTraceCache::FusedTraceCache(const program::Program& program,
                                 const std::vector<DecodedInstruction>& decoded, RegisterFile& register_file,
                                 Executor& executor, InstructionSet isa, const FusionOptions& options,
                                 unsigned threads, std::size_t parallel_cells) {
  if (!options.enabled) return;
  entries_.resize(program.code.size());
  back_buffers_.resize(register_file.registers.size());
  const InstructionSet code_isa = options.enable_jit ? isa : InstructionSet::kPortable;
  Builder{*this, program, decoded, register_file, executor, code_isa, options, threads, parallel_cells}
      .compile_reachable_traces();
}

}  // namespace apron::vm
