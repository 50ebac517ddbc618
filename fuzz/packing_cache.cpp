// Files of the packing cache: what is read has sound numbers, and what is written is read again.
// Covers: src/packing/packing_file.cpp src/internal/packing/byte_stream.h

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>

#include "internal/packing/byte_stream.h"
#include "packing/packing_file.h"
#include "support/byte_reader.h"
#include "support/check.h"

namespace {

using ist::fuzz::ByteReader;

const std::string& key() {
  static const std::string kKey(ist::kPackingKeySize, '0');
  return kKey;
}

ist::Packing packing_from(ByteReader* in) {
  ist::Packing packing;
  for (double* value : {&packing.certificate.max_gap, &packing.certificate.mean_gap,
                        &packing.certificate.interior_gap, &packing.certificate.unreachable_area,
                        &packing.certificate.surface_area}) {
    *value = in->number(0.1);
  }
  packing.certificate.reached = in->flag();
  while (in->left() > 0) {
    ist::InnerSphere sphere;
    for (double& v : sphere.center) v = in->number(1.0);
    sphere.radius = in->number(0.1);
    sphere.cover_radius = in->number(0.1);
    packing.spheres.push_back(sphere);
  }
  return packing;
}

void check_read(const std::string& bytes) {
  ist::Packing packing;
  const std::string fault = ist::parse_packing(bytes, key(), &packing);
  if (!fault.empty()) return;
  FUZZ_CHECK(!packing.spheres.empty(), "no sphere");
  for (const ist::InnerSphere& sphere : packing.spheres) {
    FUZZ_CHECK(sphere.center.allFinite() && std::isfinite(sphere.radius) &&
                   std::isfinite(sphere.cover_radius) && sphere.cover_radius >= sphere.radius &&
                   sphere.cover_radius >= 0.0,
               "radius %g, cover radius %g", sphere.radius, sphere.cover_radius);
  }
  // What is written is read again as it was; a damaged flag may have another value in the file.
  const std::string written = ist::serialize_packing(key(), packing);
  ist::Packing again;
  FUZZ_CHECK(ist::parse_packing(written, key(), &again).empty(), "what is written is not read");
  FUZZ_CHECK(ist::serialize_packing(key(), again) == written, "%zu spheres are read otherwise",
             packing.spheres.size());
}

}  // namespace

// Byte 0: bit 0 a packing made of the rest, which is written and read; else the rest is a file, and
// with bit 1 its checksum is made right.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  ByteReader in(data, size);
  const std::uint8_t kind = in.byte();
  if ((kind & 1U) != 0) {
    check_read(ist::serialize_packing(key(), packing_from(&in)));
    return 0;
  }
  std::string bytes(reinterpret_cast<const char*>(in.rest()), in.left());
  constexpr std::size_t kChecksum = sizeof(std::uint64_t);
  if ((kind & 2U) != 0 && bytes.size() >= kChecksum) {
    const std::uint64_t hash = XXH64(bytes.data(), bytes.size() - kChecksum, 0);
    std::memcpy(&bytes[bytes.size() - kChecksum], &hash, kChecksum);
  }
  check_read(bytes);
  return 0;
}
