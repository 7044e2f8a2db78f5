# Runs the two commands of the README: docker build --tag podusv . && docker run podusv
FROM python:3.13-slim
RUN apt-get update && apt-get install --yes --no-install-recommends git make && rm -rf /var/lib/apt/lists/*
WORKDIR /podusv
COPY . .
RUN make .venv/dev.done
CMD ["sh", "-c", "make reproduce && make test"]
