"""Models in this process, through transformers."""

from __future__ import annotations

import time
from collections.abc import Sequence
from importlib.util import find_spec
from typing import Any

from ..core.messages import JsonSchema, Message, PromptRefused, PromptTooLong, Reply, StructuredBy, Usage
from .constrained_decoding import SchemaProcessor
from .images import showable
from .loaded_model import INSTALL_HINT, LoadedModel, load, release
from .model_files import model_folder
from .options import REPLY_TOKENS, BackendOptions
from .prompt_fitting import ContextTooSmallError, drop_memory
from .route import NotReady, Route
from .structured_output import held_by, with_schema_in_prompt

# A short context is shared: the reply gets at least this part of it.
_LEAST_REPLY_SHARE = 0.25
# GPT-OSS speaks on several channels; a reply that is an object from its first token belongs on this one.
_HARMONY_CHANNEL, _HARMONY_FINAL = "<|channel|>", "<|channel|>final<|message|>"


class TransformersRoute(Route):
    """Hugging Face models in this process."""

    on_own_machines = True

    def check(self, model: str) -> NotReady | None:
        """Whether the libraries and the model's files are on this machine."""
        missing = [package for package in ("torch", "transformers", "llguidance") if find_spec(package) is None]
        if missing:
            return NotReady(f"{' and '.join(missing)} not installed", INSTALL_HINT)
        if model_folder(model) is None:
            return NotReady("not downloaded", f"hf download {model}", made_ready_by_opening=True)
        return None

    def open(self, model: str, name: str) -> TransformersBackend:
        """See `Route.open`."""
        return TransformersBackend(model, self.options, name)


class TransformersBackend:
    """A model in this process: a folder in Hugging Face format, or a name on the hub."""

    sees_images = False

    def __init__(self, model: str, options: BackendOptions, name: str) -> None:
        self.name = name
        self._model = model
        self._options = options
        self._loaded: LoadedModel = load(model, options.quantisation)
        self._first = True
        self._closed = False

    def complete(self, messages: Sequence[Message], schema: JsonSchema, *, seed: int) -> Reply:
        """See `bsa.core.messages.Backend.complete`."""
        notes: list[str] = []
        if self._first:
            notes.append(f"{self._model} runs in this process ({self._loaded.description})")
            self._first = False
        messages = showable(messages, False, notes)
        form: StructuredBy = "text" if self._loaded.grammar_tokenizer is None else "schema"
        with self._loaded.lock:
            started = time.monotonic()
            prompt, reply_tokens = self._prompt(with_schema_in_prompt(messages, schema, form), notes)
            processor = None
            if form == "schema":
                try:
                    processor = SchemaProcessor(self._loaded, schema, prompt.shape[1], reply_tokens)
                except ValueError as error:
                    notes.append(f"the schema cannot be enforced ({str(error)[:200]})")
                    form = "text"
                    prompt, reply_tokens = self._prompt(with_schema_in_prompt(messages, schema, form), notes)
            tokens = self._generate(prompt, reply_tokens, processor, seed)
            seconds = time.monotonic() - started
            self._loaded.answered()
        notes += self._cut(tokens, reply_tokens)
        text = self._loaded.tokenizer.decode(tokens, skip_special_tokens=True)
        return Reply(
            text=text,
            usage=Usage(prompt_tokens=prompt.shape[1], completion_tokens=len(tokens), seconds=seconds),
            model=self._model,
            structured_by=held_by(form, text, schema),
            notes=tuple(notes),
        )

    def _cut(self, tokens: Sequence[int], reply_tokens: int) -> list[str]:
        """A note where the reply did not end by itself."""
        if tokens and tokens[-1] in self._loaded.end_tokens:
            return []
        if len(tokens) >= reply_tokens:
            return [f"the reply was cut at its longest length ({reply_tokens} tokens; max_reply_tokens)"]
        limit_s = self._options.timeout_s
        return [] if limit_s is None else [f"the reply was cut at its longest time ({limit_s:g} s; timeout_s)"]

    def _prompt(self, messages: Sequence[Message], notes: list[str]) -> tuple[Any, int]:
        """The prompt's tokens, shape (1, n), and how many the reply may have."""
        context = self._loaded.context_tokens
        wanted = self._options.max_reply_tokens or REPLY_TOKENS
        least = min(wanted, int(context * _LEAST_REPLY_SHARE))
        prompt = self._encode(messages)
        length = prompt.shape[1]
        while prompt.shape[1] + least > context:
            try:
                messages = drop_memory(messages, notes)
            except ContextTooSmallError:
                raise PromptTooLong(
                    f"the prompt has {length} tokens, but {self._model} has a context of {context}"
                ) from None
            prompt = self._encode(messages)
        return prompt, min(wanted, context - prompt.shape[1])

    def _encode(self, messages: Sequence[Message]) -> Any:
        tokenizer = self._loaded.tokenizer
        if tokenizer.chat_template:
            turns = [{"role": message.role, "content": message.text} for message in messages]
            effort = self._options.reasoning_effort
            extra = {} if effort is None else {"reasoning_effort": effort}
            text = tokenizer.apply_chat_template(turns, tokenize=False, add_generation_prompt=True, **extra)
            if tokenizer.convert_tokens_to_ids(_HARMONY_CHANNEL) not in (None, tokenizer.unk_token_id):
                text += _HARMONY_FINAL
            return tokenizer(text, return_tensors="pt", add_special_tokens=False)["input_ids"]
        # A base model without a template completes a plain transcript.
        text = "\n\n".join(f"{message.role.capitalize()}: {message.text}" for message in messages)
        return tokenizer(f"{text}\n\nAssistant:", return_tensors="pt")["input_ids"]

    def _generate(self, prompt: Any, reply_tokens: int, processor: SchemaProcessor | None, seed: int) -> list[int]:
        import torch
        import transformers

        model = self._loaded.model
        sampling: dict[str, Any] = {}
        temperature = self._options.temperature
        if temperature is not None:
            sampling = {"do_sample": True, "temperature": temperature} if temperature > 0 else {"do_sample": False}
        if self._options.timeout_s is not None:
            sampling["max_time"] = self._options.timeout_s
        processors = transformers.LogitsProcessorList([processor] if processor else [])
        prompt = prompt.to(model.device)
        try:
            # A random state of its own, so that neither earlier replies nor other code change this one.
            with torch.inference_mode(), torch.random.fork_rng():
                torch.manual_seed(seed)
                output = model.generate(
                    prompt,
                    attention_mask=torch.ones_like(prompt),
                    max_new_tokens=reply_tokens,
                    logits_processor=processors,
                    eos_token_id=self._loaded.end_tokens or None,
                    pad_token_id=self._loaded.end_tokens[0] if self._loaded.end_tokens else None,
                    **sampling,
                )
            return [int(token) for token in output[0, prompt.shape[1] :]]
        except torch.cuda.OutOfMemoryError:
            pass
        # Only here is what the attempt had computed out of reach, so that it can be given back.
        torch.cuda.empty_cache()
        raise PromptRefused(
            f"the prompt has {prompt.shape[1]} tokens, and beside the weights of {self._model} the GPU has no memory "
            "left for them: end other programs on the GPU, use 4-bit weights or choose a smaller model"
        )

    def close(self) -> None:
        """Leave the weights in memory, for the next run."""
        if not self._closed:
            self._closed = True
            release(self._loaded)
