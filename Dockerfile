# docker build -t cvtimg .
# docker run --rm --user "$(id -u):$(id -g)" -v "$PWD:/work" cvtimg quantize photo.jpg -k 16
# docker run --rm --network host -v "$PWD:/work:ro" cvtimg explore --no-browser photo.jpg
FROM python:3.13-slim AS build
RUN apt-get update && apt-get install --yes --no-install-recommends gcc libc6-dev
COPY . /source
RUN pip wheel --no-deps --wheel-dir /wheels /source

FROM python:3.13-slim
RUN --mount=type=bind,from=build,source=/wheels,target=/wheels \
    pip install --no-cache-dir "$(ls /wheels/*.whl)[all]"
# Without --user, nothing runs as root.
RUN useradd --create-home cvtimg && install --directory --owner cvtimg /work
# Users of --user have no home folder, which Matplotlib would complain of.
ENV MPLCONFIGDIR=/tmp/matplotlib
USER cvtimg
WORKDIR /work
ENTRYPOINT ["cvtimg"]
