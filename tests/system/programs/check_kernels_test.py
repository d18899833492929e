"""scripts/check-kernels on repositories of our own: what is equal, what differs, and what is refused."""
import shutil
import sys

from programs import *

PROGRAM = """\
#include <scamp5.hpp>
#include <vs_stopwatch.hpp>
#include "parts/limit.hpp"
using namespace SCAMP5_PE;
vs_stopwatch timer;

int main() {
  vs_init();
  auto display = vs_gui_add_display("edges", 0, 0);
  int is_wide = 1, threshold = 3 * LIMIT, way = 0;
  vs_gui_add_switch("wide", is_wide == 1, &is_wide);
  vs_gui_add_slider("threshold", 0, 127, 12, &threshold);
  while (1) {  // while(1)
    vs_frame_loop_control();
    timer.reset();
    scamp5_kernel_begin();
      get_image(C, D);
      subx(A, C, east, C);
      abs(B, A);
    scamp5_kernel_end();
    if (is_wide) {
      scamp5_diffuse(C, 2);
      newsblurh(F, C, 1);
    }
    limit(B, threshold);
    switch (way++ % 3) {
      case 0:
        scamp5_shift(R5, 2, -3);
      case 1:
        scamp5_draw_begin(R6);
        scamp5_draw_rect(4, 20, 9, 12);
        scamp5_draw_line(0, 3, 18, 30);
        scamp5_draw_circle(14, 14, 9);
        scamp5_draw_negate();
        scamp5_draw_end();
        break;
      default:
        scamp5_flood(R5, R6, 1);
    }
    scamp5_in(E, scamp5_global_sum_64(B) % 50);
    int us = timer.get_usec();
    vs_post_text("%d us", us);
    scamp5_output_image(R5, display);
  }
}
"""
LIMIT = """\
#pragma once
#define LIMIT 4
void limit(AREG image, int level) {
  scamp5_in(E, level);
  scamp5_kernel_begin();
    sub(E, image, E);
    where(E);
      MOV(R5, FLAG);
    all();
    DNEWS(R7, R5, north | west, 1);
  scamp5_kernel_end();
}
"""
FUNCTIONS = """\
#include <scamp5.hpp>
namespace chip {
namespace bits {
  void grow(dreg_t image, int steps, bool edge = false) {
    for (int i = 0; i < steps; i++) {
      scamp5_dynamic_kernel_begin();
        DNEWS(R10, image, alldir, false);
        OR(image, R10);
      scamp5_dynamic_kernel_end();
    }
    if (edge) scamp5_load_rect(R11, 3, 3, 9, 9);
  }
}
  enum Which { FIRST, SECOND, THIRD };
  void choose(Which which) {
    switch (which) {
      case FIRST: case SECOND: scamp5_kernel_begin(); neg(A, B); scamp5_kernel_end(); break;
      default: scamp5_kernel_begin(); divq(A, B); scamp5_kernel_end();
    }
  }
  int halves(AREG image, news_t way) {
    scamp5_kernel_begin();
      divq(E, image);
      diva(image, F, D);
      movx(image, image, north);
    scamp5_kernel_end();
    return 3;
  }
}
scamp5_kernel twice([]{
  mov(F, A);
  add(A, A, F);
});
"""
LIST = "scamp5_kernel_begin();\nmovx(B, A, north);\nsub2x(C, A, east, east, B);\nMUX(R8, R5, R6, R7);\nscamp5_kernel_end();\n"
HOST = """\
#include <scamp5.hpp>
int main() {
  uint8_t event[2];
  scamp5_scan_events(R5, event, 1);
  int x = event[0];
  scamp5_kernel_begin();
    res(A);
  scamp5_kernel_end();
  scamp5_load_point(R6, 3, x);
}
"""


@unittest.skipUnless(shutil.which("g++"), "needs g++")
class CheckKernels(ProgramTest):
    def repository(self, **files):
        folder = self.folder / "repository"
        for name, text in files.items():
            path = folder / name.replace("__", "/")
            path = path.with_name(path.name.replace("_cpp", ".cpp").replace("_hpp", ".hpp"))
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        return folder

    def check(self, folder, wanted, bin_folder=BIN):
        report = self.folder / "report.md"
        status, out, err = self.finish(self.start(sys.executable, "-B", str(ROOT / "scripts/check-kernels"), f"someone/kernels@0123456789abcdef={folder}",
                                                  "--size", "32", "--frames", "4", "--report", str(report), "--bin", str(bin_folder)))
        self.assertEqual(status, wanted, out + err)
        return out, report.read_text()

    def test_kernels_of_a_repository(self):
        folder = self.repository(main_cpp=PROGRAM, parts__limit_hpp=LIMIT, functions_cpp=FUNCTIONS, list_cpp=LIST, host_cpp=HOST, other_cpp="int f();")
        out, report = self.check(folder, 0)
        self.assertEqual(out.replace("someone/kernels/", "").splitlines(), [
            "functions.cpp: equal: 4 functions",
            "host.cpp: refused: 'x', which is the controller's, reaches an instruction or decides about it",
            "list.cpp: equal",
            "main.cpp: equal",
            "parts/limit.hpp: equal: 1 functions"])
        self.assertIn("| someone/kernels | `0123456789` | 5 | 4 | 4 | 4 | 4 | 0 |\n", report)
        self.assertIn("| someone/kernels: host.cpp | refused | 'x', which", report)

    def test_a_wrong_import_is_seen(self):
        folder = self.repository(main_cpp=PROGRAM, parts__limit_hpp=LIMIT, functions_cpp=FUNCTIONS, list_cpp=LIST)
        wrong = self.folder / "bin"
        wrong.mkdir()
        # What the import gives takes another neighbour, and the third frame another threshold.
        (wrong / "apron").write_text(f"""#!/bin/sh
'{APRON}' "$@" || exit
[ "$1" = import ] || exit 0
for file; do :; done
sed -i -e 's/movx(\\(.*\\), north)/movx(\\1, south)/' -e "s/DNEWS1(R7/DNEWS0(R7/" "$file"
""")
        (wrong / "apron").chmod(0o755)
        out, report = self.check(folder, 1, wrong)
        self.assertRegex(out, r"functions.cpp: differs: halves: A \d+")
        self.assertRegex(out, r"list.cpp: differs: B \d+, C \d+")
        self.assertRegex(out, r"main.cpp: differs: frame 1: R7 \d+\n")
        self.assertIn("| 4 | 4 | 4 | 4 | 0 | 4 |", report)


if __name__ == "__main__":
    unittest.main()
