// Runs a fuzzer's corpus, and mutations of it from a fixed seed, where there is no libFuzzer.
//   replay CORPUS_FOLDER ROUNDS
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t*, std::size_t);

namespace {

using Bytes = std::vector<std::uint8_t>;

std::vector<Bytes> corpus_in(const char* folder) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) files.push_back(entry.path());
  std::ranges::sort(files);  // the same order everywhere
  std::vector<Bytes> corpus;
  for (const auto& file : files) {
    std::ifstream in(file, std::ios::binary);
    corpus.emplace_back(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
  }
  return corpus;
}

void mutate(Bytes& bytes, std::mt19937& random) {
  for (auto n = random() % 8 + 1; n > 0; --n) {
    const std::size_t at = bytes.empty() ? 0 : random() % bytes.size();
    const auto value = static_cast<std::uint8_t>(random());
    if (bytes.empty() || random() % 4 == 0)
      bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(at), value);
    else if (random() % 8 == 0)
      bytes.erase(bytes.begin() + static_cast<std::ptrdiff_t>(at));
    else
      bytes[at] = random() % 2 ? value : static_cast<std::uint8_t>(bytes[at] ^ 1u << random() % 8);
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  const auto corpus = corpus_in(argv[1]);
  if (corpus.empty()) return std::fprintf(stderr, "%s: no corpus\n", argv[1]), 2;
  for (const Bytes& bytes : corpus) LLVMFuzzerTestOneInput(bytes.data(), bytes.size());
  std::mt19937 random(2024);
  for (int round = std::atoi(argv[2]); round > 0; --round) {
    Bytes bytes = corpus[random() % corpus.size()];
    if (random() % 2) {  // two inputs in a row
      const Bytes& more = corpus[random() % corpus.size()];
      bytes.insert(bytes.end(), more.begin(), more.end());
    }
    mutate(bytes, random);
    LLVMFuzzerTestOneInput(bytes.data(), bytes.size());
  }
}
