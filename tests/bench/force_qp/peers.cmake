# Adds each peer to bench_force_qp. What is compiled here is compiled as its authors do (-O3) and for this machine
# (-march=native: our engine chooses its path at run time, the peers when they are compiled), condensing included;
# with the alignment that the rest of the project has, so that Eigen's types are the same.
set(native -O3 -march=native -DEIGEN_MAX_ALIGN_BYTES=16 -Wno-uninitialized -Wno-maybe-uninitialized)  # GCC 12, of AVX-512 intrinsics
set(peer_flags ${native} -w)
set_target_properties(bench_force_qp PROPERTIES EXCLUDE_FROM_ALL ON)  # the peers take minutes: `make bench` asks for it
target_compile_options(bench_force_qp PRIVATE ${native})
# So that libraries of libraries are found beside them.
target_link_options(bench_force_qp PRIVATE -Wl,--disable-new-dtags)
set(peers "${STANCE_BENCH_PEERS}")

file(GLOB daqp_sources "${peers}/daqp/csrc/src/*.c")
add_library(bench_daqp STATIC EXCLUDE_FROM_ALL ${daqp_sources})
target_include_directories(bench_daqp SYSTEM PUBLIC "${peers}/daqp/csrc/include")
target_compile_options(bench_daqp PRIVATE ${peer_flags})

# stance_bench_peer(NAME [INCLUDES ...] [LIBRARIES ...] [FLAGS ...]): force_qp/NAME.cpp as a library of its own.
function(stance_bench_peer name)
  cmake_parse_arguments(ARG "" "" "INCLUDES;LIBRARIES;FLAGS" ${ARGN})
  add_library(bench_peer_${name} OBJECT EXCLUDE_FROM_ALL force_qp/${name}.cpp)
  target_include_directories(bench_peer_${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_include_directories(bench_peer_${name} SYSTEM PRIVATE ${ARG_INCLUDES})
  target_link_libraries(bench_peer_${name} PRIVATE stance::force_qp stance_flags ${ARG_LIBRARIES})
  target_compile_options(bench_peer_${name} PRIVATE ${native} ${ARG_FLAGS})
  target_link_libraries(bench_force_qp PRIVATE bench_peer_${name} ${ARG_LIBRARIES})
  string(TOUPPER "STANCE_BENCH_${name}" found)
  target_compile_definitions(bench_force_qp PRIVATE ${found})
endfunction()
stance_bench_peer(daqp LIBRARIES bench_daqp)
stance_bench_peer(eiquadprog INCLUDES "${peers}/cmeel/include" LIBRARIES "${peers}/cmeel/lib/libeiquadprog.so")
stance_bench_peer(qpoases INCLUDES "${peers}/cmeel/include" LIBRARIES "${peers}/cmeel/lib/libqpOASES.so")
stance_bench_peer(proxqp INCLUDES "${peers}/cmeel/include" FLAGS -w)
stance_bench_peer(piqp INCLUDES "${peers}/piqp/include" FLAGS -w)
stance_bench_peer(hpipm INCLUDES "${peers}/acados/include/hpipm/include" "${peers}/acados/include/blasfeo/include"
  LIBRARIES "${peers}/acados/lib/libhpipm.so" "${peers}/acados/lib/libblasfeo.so")
