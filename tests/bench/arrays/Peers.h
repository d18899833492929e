// The peers of the array benchmark: each implements the workloads W1 to W6, which the .aps files here define.
#pragma once

#include <cstddef>
#include <cstdlib>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "apron/vm/kernels/Kernels.h"

namespace arrays {

// rows x columns floats, zero at first. Rows are 64-byte aligned; one zero row lies above and below the
// array, and at least 16 zero floats on each side of every row. Throws std::bad_alloc.
class Image {
 public:
  explicit Image(int n) : Image(n, n) {}
  Image(int rows, int columns);
  float* row(int r) { return first_ + r * pitch_; }
  const float* row(int r) const { return first_ + r * pitch_; }
  int n() const { return n_; }
  std::ptrdiff_t pitch() const { return pitch_; }
  double checksum() const;  // weighted sum; weights depend on the position

 private:
  struct Free {
    void operator()(float* p) const { std::free(p); }
  };
  int n_;
  std::ptrdiff_t pitch_;
  std::unique_ptr<float[], Free> cells_;
  float* first_;
};

// Input data, identical for all peers.
float uniform(int row, int column, int which);  // 0.1 to 1
float disc_pattern(int row, int column);        // 0 or 1: discs some cells across
float random_life(int row, int column);         // 0 or 1: 3/8 alive
int inputs(int workload);                       // number of input images
Image input(int workload, int n, int which);

struct Job {
  std::function<void()> run;         // one run over the whole array
  std::function<double()> checksum;  // over all results of the first run
};

// Each returns nullopt if the peer is not available, does not implement the workload, or needs instructions
// that this CPU lacks. `n` is the side of the array. Only make_apron_job() uses more than one thread.
std::optional<Job> make_apron_job(int workload, int n, unsigned threads, apron::vm::InstructionSet isa);
// The program filters/NAME.aps, from register A to register B; nullopt without the instruction set.
std::optional<Job> make_filter_job(const std::string& name, int n, apron::vm::InstructionSet isa);
// C = call, of the registers A and B, from .1 to 1.
std::optional<Job> make_mathematics_job(const std::string& call, int n, apron::vm::InstructionSet isa);
std::optional<Job> make_unfused_job(int workload, int n);
std::optional<Job> make_hand_fused_job(int workload, int n);
std::optional<Job> make_eigen_job(int workload, int n);
std::optional<Job> make_halide_job(int workload, int n, apron::vm::InstructionSet isa);

}  // namespace arrays
