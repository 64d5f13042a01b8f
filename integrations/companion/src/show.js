// The connection to a show: commands by HTTP, events by server-sent events. It connects again by itself.

import { EventEmitter } from 'node:events'

/** Times between two attempts to connect, in milliseconds: the first, and the longest. */
const RETRY_MS = [500, 5000]
/** Longest time for a command, in milliseconds. */
const COMMAND_MS_MAX = 3000
/** Longest time without an event before the connection counts as lost, in milliseconds. A show sends five per second. */
const SILENCE_MS_MAX = 4000

/** A show. Events: `about` (what GET /api says, at each connection and when labels have changed), `state`, `beat`, `lost` (a reason). */
export class Show extends EventEmitter {
	#base
	#headers
	#retry
	#closed = false
	#abort = new AbortController()

	/** `host` is a name or an IP address; `token` may be empty. `retryMs` is the first and the longest time between attempts. */
	constructor({ host, port, token }, retryMs = RETRY_MS) {
		super()
		const name = host.includes(':') && !host.startsWith('[') ? `[${host}]` : host
		this.#base = `http://${name}:${port}`
		this.#headers = token ? { Authorization: `Bearer ${token}` } : {}
		this.#retry = retryMs
		this.#run()
	}

	/** Sends a command. Throws an error with the reason if the show refuses it or does not answer. */
	async send(command, body) {
		const answer = await fetch(`${this.#base}/api/${command}`, {
			method: 'POST',
			headers: this.#headers,
			body: body === undefined ? undefined : JSON.stringify(body),
			signal: AbortSignal.any([this.#abort.signal, AbortSignal.timeout(COMMAND_MS_MAX)]),
		})
		const text = await answer.text()
		if (!answer.ok) throw new Error(reason(text) || `HTTP ${answer.status}`)
	}

	/** Ends the connection. */
	close() {
		this.#closed = true
		this.#abort.abort()
	}

	async #run() {
		let wait = this.#retry[0]
		while (!this.#closed) {
			try {
				await this.#listen(() => (wait = this.#retry[0]))
				this.#tell('lost', 'the show has ended')
			} catch (error) {
				this.#tell('lost', error.cause?.message || error.message)
			}
			if (this.#closed) return
			await new Promise((done) => setTimeout(done, wait))
			wait = Math.min(2 * wait, this.#retry[1])
		}
	}

	#tell(event, value) {
		if (!this.#closed) this.emit(event, value)
	}

	async #about() {
		const signal = AbortSignal.any([this.#abort.signal, AbortSignal.timeout(COMMAND_MS_MAX)])
		const answer = await fetch(`${this.#base}/api`, { headers: this.#headers, signal })
		const text = await answer.text()
		if (!answer.ok) throw new Error(reason(text) || `HTTP ${answer.status}`)
		const about = JSON.parse(text)
		if (about.name !== 'Corybant' || about.api !== 1) throw new Error('this is not a Corybant with version 1 of the HTTP API')
		return about
	}

	async #listen(connected) {
		this.#tell('about', await this.#about())
		const silence = new AbortController()
		const signal = AbortSignal.any([this.#abort.signal, silence.signal])
		const answer = await fetch(`${this.#base}/api/events`, { headers: this.#headers, signal })
		if (!answer.ok) throw new Error(reason(await answer.text()) || `HTTP ${answer.status}`)
		connected()
		const lost = () => silence.abort(new Error('the show does not answer'))
		let timer = setTimeout(lost, SILENCE_MS_MAX)
		let rest = ''
		try {
			for await (const text of answer.body.pipeThrough(new TextDecoderStream())) {
				clearTimeout(timer)
				timer = setTimeout(lost, SILENCE_MS_MAX)
				const parts = (rest + text).split('\n\n')
				rest = parts.pop()
				for (const part of parts) await this.#event(part)
			}
		} finally {
			clearTimeout(timer)
		}
	}

	async #event(part) {
		const field = (name) => part.split('\n').find((line) => line.startsWith(`${name}: `))?.slice(name.length + 2)
		const [kind, data] = [field('event'), field('data')]
		if (kind === 'names') this.#tell('about', await this.#about())
		else if (kind && data) this.#tell(kind, JSON.parse(data))
	}
}

/** The reason in the body of a refusal. */
function reason(text) {
	try {
		return JSON.parse(text).message
	} catch {
		return text.trim()
	}
}
