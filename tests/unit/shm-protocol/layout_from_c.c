/* The header as a C11 compiler sees it; LayoutTest.cpp compares with C++. */
#include <shm_protocol/layout.h>

size_t layout_sizes_from_c(size_t which) {
  const size_t sizes[] = {sizeof(ssp_header), sizeof(ssp_channel), sizeof(ssp_slot),
                          offsetof(ssp_header, sensors)};
  return which < sizeof sizes / sizeof sizes[0] ? sizes[which] : 0;
}
