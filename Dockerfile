# axiswatch in a container.
#   tools/build-image.sh
#   docker run --network host -v /etc/axiswatch:/etc/axiswatch:ro -v axiswatch:/var/lib/axiswatch axiswatch
# --network host: SocketCAN interfaces belong to the host's network namespace.
#
# In the configuration: state_dir = "/var/lib/axiswatch" in [service].
# 127.0.0.1, the default of [web], is that of the host, and only the host reaches the page. For other machines:
# host = "0.0.0.0", hosts, certificate and key in [web] of the mounted configuration (the user axiswatch must be able to
# read the key), and a token:
#   docker run --rm -v /etc/axiswatch:/etc/axiswatch:ro -v axiswatch:/var/lib/axiswatch axiswatch \
#     axiswatch token new NAME --scope read --config /etc/axiswatch/axiswatch.toml
# A published port (-p) reaches the container only by host = "0.0.0.0", too.

# Any image with python3 (3.11 or newer), venv and pip.
ARG BASE_IMAGE=docker.io/library/python:3.11-slim

FROM ${BASE_IMAGE} AS build
WORKDIR /src
RUN command -v strip || { apt-get update && apt-get install --yes --no-install-recommends binutils; }
RUN python3 -m venv /opt/axiswatch
COPY requirements-runtime.lock ./
# A mirror of PyPI: tools/build-image.sh --secret id=pip.conf,src=FILE, which leaves no trace in the image.
RUN --mount=type=secret,id=pip.conf,target=/etc/pip.conf \
    /opt/axiswatch/bin/pip install --no-cache-dir --no-compile --require-hashes -r requirements-runtime.lock
COPY pyproject.toml README.md hatch_build.py ./
COPY docs/openapi.json docs/
COPY monitor_core monitor_core
COPY service service
COPY config config
# numba knows a compiled kernel by its source's modification time, and image layers keep whole seconds only:
# round first, then compile.  Others' Python is there as bytecode alone, which is half of it and starts as fast; a
# traceback names its lines but does not show them.  What else goes: tests, symbols, C sources, the installer, pyarrow's
# ways to other machines and its libraries' second names, formats of pictures and fonts that reports never write.  What
# was repaired for its wheel (*.libs) keeps its symbols: once stripped, it cannot be loaded.  The
# dashboard is that of service/web/static where it is built, else npm must be reached.
RUN --mount=type=secret,id=pip.conf,target=/etc/pip.conf \
    /opt/axiswatch/bin/pip install --no-cache-dir --no-compile --no-deps . \
 && /opt/axiswatch/bin/pip uninstall --yes setuptools pip \
 && cd /opt/axiswatch/lib/python3*/site-packages \
 && find . -type d -name tests -prune -exec rm -r {} + \
 && find . -regex '.*\.\(pyi\|pxd\|pyx\|pxi\|c\|cc\|h\|hpp\|cpp\|a\)' -delete \
 && rm -rf pyarrow/include pyarrow/src pyarrow/*_flight* pyarrow/*_s3* pyarrow/*_encryption* \
      pyarrow/*_orc* pyarrow/_azurefs* pyarrow/_gcsfs* pyarrow/_hdfs* pyarrow/_substrait* \
      pyarrow/libarrow_python.so pyarrow/libarrow_python.so.*.*.* PIL/_avif* pillow.libs/libavif-* \
      scipy/io/_fast_matrix_market/_fmm_core* numba/cuda numba/np/ufunc/*pool.* numpy/distutils \
      matplotlib/mpl-data/fonts/afm matplotlib/mpl-data/fonts/pdfcorefonts \
 && find fontTools -mindepth 1 -maxdepth 1 -type d -not -name misc -exec rm -r {} + \
 && find . -name '*.so*' -type f -not -path '*.libs/*' -exec strip --strip-unneeded {} + \
 && find . -name '*.py' -exec touch -d "@$(date +%s)" {} + \
 && python3 -m compileall -q -j 0 monitor_core service \
 && others() { find . -name '*.py' -not -path './monitor_core/*' -not -path './service/*' "$@"; } \
 && others -exec python3 -m compileall -q -b {} + \
 && others -delete

# The base without what a container never runs or loads.
FROM ${BASE_IMAGE} AS run
RUN cd "$(python3 -c 'import sysconfig; print(sysconfig.get_path("stdlib"))')" \
 && rm -rf site-packages ensurepip idlelib lib2to3 pydoc_data test tkinter turtledemo \
 && find . -name __pycache__ -prune -exec rm -r {} + && python3 -m compileall -q -b . && find . -name '*.py' -delete \
 && if command -v dpkg; then dpkg --purge --force-all $(dpkg-query -Wf '${Package} ' 'perl*' 'libperl*' usrmerge \
      apt 'libapt-pkg*' gpgv debian-archive-keyring debconf adduser python3-venv 'python3*-venv' 'python3-*-whl' \
      python3-distutils python3-lib2to3 'libgnutls*' 'libhogweed*' 'libnettle*' 'libp11-kit*' 'libunistring*' \
      'libidn2*' 'libtasn1*' e2fsprogs logsave 'libext2fs*' 'libss2*' mount util-linux bsdutils diffutils \
      ncurses-bin 2>/dev/null); fi \
 && rm -rf /usr/lib/*/gconv /usr/share/zoneinfo/right /usr/share/python-wheels /var/cache/* /var/log/* \
      /var/lib/apt /var/lib/dpkg/info
COPY --from=build /opt/axiswatch /opt/axiswatch
RUN useradd --system --no-create-home --home-dir /var/lib/axiswatch --shell /usr/sbin/nologin axiswatch \
 && install -d -o axiswatch -g axiswatch /var/lib/axiswatch /var/cache/axiswatch && install -d /etc/axiswatch

FROM scratch
COPY --from=run / /
ENV PATH=/opt/axiswatch/bin:/usr/local/bin:/usr/local/sbin:/usr/bin:/usr/sbin:/bin:/sbin LANG=C.UTF-8 \
    PYTHONUNBUFFERED=1 \
    NUMBA_CACHE_DIR=/var/cache/axiswatch \
    OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 MKL_NUM_THREADS=1 NUMBA_NUM_THREADS=1
USER axiswatch
WORKDIR /var/lib/axiswatch
# Daemon, identify and excite, compiled for the processor that builds the image; on another kind the first start of
# each compiles again.  Not in the volume: that of an older image would hide it.
RUN axiswatch warm
VOLUME /var/lib/axiswatch
EXPOSE 8080
# Without TLS, or with it; the certificate is that of another name than 127.0.0.1, and this is the same machine.
HEALTHCHECK --interval=10s --timeout=5s --start-period=60s --retries=3 \
  CMD for scheme in http https; do python -c "import ssl, sys, urllib.request as r; \
      r.urlopen(sys.argv[1], timeout=2, context=ssl._create_unverified_context())" $scheme://127.0.0.1:8080/healthz \
      2>/dev/null && exit 0; done; exit 1
CMD ["axiswatch", "run", "--config", "/etc/axiswatch/axiswatch.toml"]
