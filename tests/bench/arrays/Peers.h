// What the array benchmark compares: the workloads W1 to W6 (the .aps files here) by one way of writing them
// each.
#pragma once

#include <cstddef>
#include <cstdlib>
#include <functional>
#include <memory>
#include <optional>
#include <string>

namespace arrays {

// n x n floats, rows 64-byte aligned, one zero row above and below and 16 zero floats beside each row.
class Image {
 public:
  explicit Image(int n) : Image(n, n) {}
  Image(int rows, int columns);
  float* row(int r) { return first_ + r * pitch_; }
  const float* row(int r) const { return first_ + r * pitch_; }
  int n() const { return n_; }
  std::ptrdiff_t pitch() const { return pitch_; }
  double checksum() const;  // weights depend on the place

 private:
  struct Free {
    void operator()(float* p) const { std::free(p); }
  };
  int n_;
  std::ptrdiff_t pitch_;
  std::unique_ptr<float[], Free> cells_;
  float* first_;
};

// The same numbers for everyone.
float uniform(int row, int column, int which);  // 0.1 to 1
float disc_pattern(int row, int column);        // 0 or 1: discs some cells across
float random_life(int row, int column);         // 0 or 1: 3/8 alive
int inputs(int workload);                       // how many images it reads
Image input(int workload, int n, int which);

struct Job {
  std::function<void()> run;         // once over the whole array
  std::function<double()> checksum;  // of all results, after the first run
};

// Nothing if this peer does not do it.
std::optional<Job> make_apron_job(int workload, int n, unsigned threads);
std::optional<Job> make_unfused_job(int workload, int n);
std::optional<Job> make_hand_fused_job(int workload, int n);  // one thread, as good as we can write it
std::optional<Job> make_eigen_job(int workload, int n);
std::optional<Job> make_halide_job(int workload, int n);

}  // namespace arrays
