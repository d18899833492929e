#include "apron/vm/Segments.h"

#include <algorithm>

namespace apron::vm {
namespace {

// Of all segments of a program: beyond that the rest runs step by step.
constexpr std::size_t kMaxNodes = 30'000;
constexpr std::size_t kMaxFollowed = 2'000'000;
constexpr std::size_t kMaxBytes = std::size_t{1} << 28;

}  // namespace

struct Segments::Builder {
  Segments& all;
  const program::Program& program;
  const std::vector<Step>& steps;
  Storage& storage;
  Executor& executor;
  const FuseOptions& options;
  unsigned threads;
  std::size_t parallel_cells;
  Flow flow{program, options.keep_registers};
  std::size_t nodes = 0, followed = 0, bytes = 0;

  void run() {
    std::vector<bool> seen(program.code.size(), false);
    std::vector<std::uint32_t> work{0};
    const auto go = [&](std::size_t at) {
      if (seen[at]) return;
      seen[at] = true;
      work.push_back(static_cast<std::uint32_t>(at));
    };
    seen[0] = true;
    while (!work.empty() && nodes < kMaxNodes && followed < kMaxFollowed && bytes < kMaxBytes) {
      const std::uint32_t at = work.back();
      work.pop_back();
      bool moved = false;
      for (const bool masked : {false, true}) {
        if (masked && !flow.has_masks()) continue;
        const Trace trace = follow(program, steps, flow, at, masked, {options.trace_steps});
        followed += trace.path.size() + 1;
        if (trace.path.empty()) continue;
        moved = true;
        go(trace.exit);
        if (trace.array_steps >= 2) add(trace, masked);
      }
      if (!moved) flow.successors(at, go);
    }
  }

  void add(const Trace& trace, bool masked) {
    Graph graph = build_graph(program, steps, flow, trace, masked);
    nodes += graph.nodes.size() + 1;
    PlanOptions how;
    const bool large = std::size_t{trace.width} * trace.height >= parallel_cells;
    how.threads = large ? threads : 1;
    how.slices = options.slices;
    how.strip_columns = options.strip_columns;
    how.block_rows = options.block_rows;
    how.rows_at_once = options.rows_at_once;
    Plan plan = make_plan(graph, trace.width, trace.height, how);
    Segment::Machine machine{executor, storage, all.fresh_, options.jit,
                             flow.only_zero_edges() && trace.width % kLanes == 0};
    auto segment = std::make_unique<Segment>(trace, std::move(graph), std::move(plan), machine);
    bytes += segment->memory_bytes();
    for (const std::uint32_t reg : segment->fresh_registers()) {
      Plane& fresh = all.fresh_[reg];
      if (fresh.data == nullptr) fresh = all.store_.add(trace.width, trace.height);
    }
    Entry& entry = all.entries_[trace.entry];
    (masked ? entry.masked : entry.plain) = segment.get();
    all.segments_.push_back(std::move(segment));
  }
};

Segments::Segments(const program::Program& program, const std::vector<Step>& steps, Storage& storage,
                   Executor& executor, const FuseOptions& options, unsigned threads,
                   std::size_t parallel_cells) {
  if (!options.on) return;
  entries_.resize(program.code.size());
  fresh_.resize(storage.registers.size());
  Builder{*this, program, steps, storage, executor, options, threads, parallel_cells}.run();
}

}  // namespace apron::vm
