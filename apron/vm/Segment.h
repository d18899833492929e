// A trace, compiled: runs as one pass over the array instead of one pass for each instruction.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "apron/vm/Executor.h"
#include "apron/vm/Graph.h"
#include "apron/vm/Plan.h"
#include "apron/vm/PlaneStore.h"
#include "apron/vm/StageCode.h"
#include "apron/vm/Trace.h"

namespace apron::vm {

class Segment {
 public:
  struct Machine {
    Executor& executor;
    Storage& storage;
    std::vector<Plane>& fresh;  // a second buffer for the registers that need one; exchanged with the first
    bool jit = true;
    bool clean_pads = false;  // beyond their edges all planes are zero for good
  };

  // Allocates; running does not. machine's parts must outlive the segment.
  Segment(const Trace& trace, Graph graph, Plan plan, const Machine& machine);

  // The registers, variables and fresh planes afterwards are as if the trace had been run step by step. mask:
  // the one in force, for a trace that reads it.
  void run(const ConstPlane& mask) noexcept;

  std::uint32_t exit() const noexcept { return exit_; }
  std::uint64_t steps() const noexcept { return steps_; }
  std::size_t masks() const noexcept { return masks_; }
  std::size_t calls() const noexcept { return calls_; }
  std::uint32_t width() const noexcept { return plan_.width; }
  std::uint32_t height() const noexcept { return plan_.height; }
  // Registers that it writes to a fresh plane.
  std::vector<std::uint32_t> fresh_registers() const;
  std::size_t memory_bytes() const noexcept;

 private:
  struct Place {            // of a store's rows, for one worker
    float* data = nullptr;  // of row 0, column 0 of the array or, of a ring, of the strip
    std::ptrdiff_t pitch = 0;
    std::uint32_t capacity = 0;  // of a ring, else 0
    std::int64_t margin = 0;     // rows beyond the edge that it holds
  };
  struct Worker {
    float* rings = nullptr;
    float* tile = nullptr;
    std::vector<Place> places;
  };
  struct Strip {
    std::int64_t first = 0, last = 0;  // its own columns
    std::int64_t ring_first = 0;       // the column in a ring's first place
  };

  void allocate_workers();
  std::uint32_t common_vectors(const Stage& stage) const noexcept;
  void columns_of(const Stage& stage, const Strip& strip, std::int64_t& west,
                  std::int64_t& east) const noexcept;
  void number_cells();
  void fill_margins(const Worker& worker) noexcept;
  void scalars() noexcept;
  void find_places(Worker& worker, const ConstPlane& mask) const noexcept;
  void fill_input_pads() noexcept;
  void run_slice(unsigned slice, const Worker& worker) noexcept;
  void run_stage(std::size_t stage, const Worker& worker, const Strip& strip, std::int64_t first,
                 std::int64_t last) noexcept;
  std::int64_t begin_turns(const std::vector<Stream>& lines, std::uint32_t rows, const Worker& worker,
                           const Strip& strip, std::int64_t row, std::int64_t column,
                           StageCall& call) const noexcept;
  std::int64_t locate(const Stream& stream, const Worker& worker, const Strip& strip, std::int64_t row,
                      std::int64_t column, float*& first, std::ptrdiff_t& pitch) const noexcept;
  float* cell(const Place& place, const Strip& strip, std::int64_t row, std::int64_t column) const noexcept;
  std::int64_t pitch_of(const Place& place) const noexcept;
  void pad_results(const Stage& stage, const Worker& worker, const Strip& strip, std::int64_t first,
                   std::int64_t last, std::int64_t west, std::int64_t east) const noexcept;
  void pad_rings(const Worker& worker, const Strip& strip) const noexcept;
  void pad_row(float* row, std::uint32_t reach, bool west, bool east) const noexcept;
  bool constant_edge() const noexcept;

  std::uint32_t exit_;
  std::uint64_t steps_;
  std::size_t masks_, calls_;
  Graph graph_;
  Plan plan_;
  Executor& executor_;
  Storage& storage_;
  std::vector<Plane>& fresh_;
  bool clean_pads_;
  std::vector<std::optional<StageJit>> jits_;  // nothing where a stage runs as tiles
  std::vector<StageTiles> tiles_;
  PlaneStore memory_;
  std::vector<Worker> workers_;
  float* outside_ = nullptr;  // a row of what lies beyond the edge
  Plane columns_, rows_;      // one row of the columns' numbers; every row's number in all its cells
  std::size_t worker_floats_ = 0, number_floats_ = 0;
};

}  // namespace apron::vm
